"""uSORT settings from a first-order model, for a stated largest sensitivity Ms.

Source: V. M. Alfaro and R. Vilanova, the uniform simple optimal robust tuning (uSORT), first-order
rows. The originals were not read; the constants are as a public implementation has them, and only
rows whose margins were computed here to hold their Ms within 0.05 for theta/tau of 0.1 to 2 (N 10)
are offered. Its rows for the regulatory PID at 1.6 and the servo PID at 1.8 and 1.6 lead to Ms of
1.4 to 11.6 and are left out. The set-point weight of the source is not known here: b is 1.

Range: theta/tau from 0.1 to 2, where the rows were checked; elsewhere the rule refuses.
"""

from dataclasses import dataclass
from types import MappingProxyType

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import Process
from tuning.rule import Rule, dead_time_ratio, no_notes, one_of, without_speed

TITLE = "uSORT"
SHORTEST, LONGEST = 0.1, 2.0


@dataclass(frozen=True, slots=True)
class Row:
    """Constants of one row.

    Attributes
    ----------
    a : tuple of float
        K Kc = a0 + a1 r^a2. [-]
    b : tuple of float
        Ti/tau: three for b0 + b1 r^b2 (regulator), four for (b0 + b1 r + b2 r^2)/(b3 + r)
        (servo). [-]
    c : tuple of float, optional
        Td/tau = c0 + c1 r^c2. [-]
    """

    a: tuple[float, float, float]
    b: tuple[float, ...]
    c: tuple[float, float, float] | None = None


REGULATOR_PI_20 = Row((0.265, 0.603, -0.971), (-1.382, 2.837, 0.211))
REGULATOR_PI_16 = Row((0.175, 0.466, -0.911), (-1.382, 2.837, 0.211))
REGULATOR_PID_20 = Row((0.235, 0.84, -0.919), (-0.198, 1.291, 0.485), (0.004, 0.389, 0.869))
SERVO_PI_18 = Row((0.243, 0.509, -1.063), (14.65, 8.45, 0.0, 15.74))
SERVO_PI_16 = Row((0.209, 0.417, -1.064), (0.107, 1.164, 0.377, 0.066))


def usort_settings(process: Process, row: Row) -> PID:
    """Tune a controller from r = theta/tau.

    K Kc = a0 + a1 r^a2; Ti/tau = b0 + b1 r^b2 for loads and (b0 + b1 r + b2 r^2)/(b3 + r) for set
    points; Td/tau = c0 + c1 r^c2.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    row : Row
        Constants.

    Raises
    ------
    RuleNotApplicable
        theta/tau lies outside 0.1 to 2, or the process has another type.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> pid = usort_settings(FOPDT(K=1.0, tau=1.0, theta=1.0), REGULATOR_PI_20)
    >>> round(pid.Kc, 3), round(pid.Ti, 3)
    (0.868, 1.455)
    """
    model, r = dead_time_ratio(process, TITLE)
    if not SHORTEST * (1 - 1e-9) <= r <= LONGEST * (1 + 1e-9):
        raise RuleNotApplicable(
            TITLE,
            f"its constants hold for theta/tau from {SHORTEST:g} to {LONGEST:g}, here it is "
            f"{r:.3g}",
        )
    if len(row.b) == 3:
        Ti = row.b[0] + row.b[1] * r ** row.b[2]
    else:
        Ti = (row.b[0] + row.b[1] * r + row.b[2] * r**2) / (row.b[3] + r)
    Td = row.c[0] + row.c[1] * r ** row.c[2] if row.c else 0.0
    return PID(
        Kc=(row.a[0] + row.a[1] * r ** row.a[2]) / abs(model.K),
        Ti=Ti * model.tau,
        Td=Td * model.tau,
        action=Action.for_gain(model.K),
    )


def _rule(name: str, title: str, aim: str, **rows: Row) -> Rule:
    return Rule(
        name=name,
        title=title,
        source="Alfaro & Vilanova, uSORT, as a public implementation has it",
        status="confirmed",
        aim=aim,
        form="ISA",
        validity="theta/tau from 0.1 to 2",
        structures=MappingProxyType(
            {
                structure: without_speed(name, one_of(usort_settings, row))
                for structure, row in rows.items()
            }
        ),
        takes=MappingProxyType(dict.fromkeys(rows, ("FOPDT",))),
        notes=no_notes,
    )


USORT_RULES = (
    _rule(
        "usort_load_20",
        "uSORT (load, Ms 2.0)",
        "the least IAE after a load step with Ms 2",
        PI=REGULATOR_PI_20,
        PID=REGULATOR_PID_20,
    ),
    _rule(
        "usort_load_16",
        "uSORT (load, Ms 1.6)",
        "the least IAE after a load step with Ms 1.6",
        PI=REGULATOR_PI_16,
    ),
    _rule(
        "usort_setpoint_18",
        "uSORT (set point, Ms 1.8)",
        "the least IAE after a set-point step with Ms 1.8",
        PI=SERVO_PI_18,
    ),
    _rule(
        "usort_setpoint_16",
        "uSORT (set point, Ms 1.6)",
        "the least IAE after a set-point step with Ms 1.6",
        PI=SERVO_PI_16,
    ),
)
