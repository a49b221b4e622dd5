"""AMIGO settings from the ultimate point and the steady-state gain.

Source: K. J. Åström and T. Hägglund, Advanced PID Control, ISA, 2006, from memory. The original
was not read and no second source was found. Computed here on first-order models: Ms is 1.36 to
1.46 for the PI and 1.44 to 1.54 for the PID where the gain ratio kappa = 1/(K Ku) is 0.12 or more;
the PI on an integrator (kappa 0) has Ms 1.76 and Mt 1.89.

Range: the PID for kappa above 0.2 (from memory); below, the rule refuses its PID.
"""

import math
from types import MappingProxyType

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import Process, static_gain
from tuning.rule import Rule, without_speed
from tuning.ultimate import SOURCE_TEXT, UltimatePoint, ultimate_point

TITLE = "AMIGO (frequency)"
SMALLEST_RATIO, CHECKED_RATIO = 0.2, 0.12


def _point_and_ratio(process: Process) -> tuple[UltimatePoint, float]:
    """Ultimate point, and kappa = 1/(K Ku), 0 for an integrator. [-]"""
    point = ultimate_point(process, rule=TITLE)
    K = abs(static_gain(process))
    return point, 0.0 if math.isinf(K) else 1 / (K * point.Ku)


def amigo_frequency_pi(process: Process) -> PID:
    """Tune a PI controller: Kc = 0.16 Ku, Ti = Pu/(1 + 4.5 kappa), kappa = 1/(K Ku).

    Parameters
    ----------
    process : FOPDT, SOPDT or IPDT
        Process model; kappa is 0 for an integrator. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> pid = amigo_frequency_pi(FOPDT(K=2.0, tau=120.0, theta=30.0))
    >>> round(pid.Kc, 4), round(pid.Ti, 2)
    (0.5548, 66.64)
    """
    point, ratio = _point_and_ratio(process)
    return PID(Kc=0.16 * point.Ku, Ti=point.Pu / (1 + 4.5 * ratio), action=point.action)


def amigo_frequency_pid(process: Process) -> PID:
    """Tune a PID controller from Ku, Pu and kappa = 1/(K Ku).

    Kc = (0.3 - 0.1 kappa^4) Ku, Ti = 0.6 Pu/(1 + 2 kappa),
    Td = 0.15 (1 - kappa) Pu/(1 - 0.95 kappa).

    Parameters
    ----------
    process : FOPDT or SOPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        kappa is 0.2 or less, there is no dead time, or the process has another type.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> pid = amigo_frequency_pid(FOPDT(K=2.0, tau=60.0, theta=30.0))
    >>> round(pid.Kc, 4), round(pid.Ti, 2), round(pid.Td, 2)
    (0.5701, 40.37, 15.13)
    """
    point, ratio = _point_and_ratio(process)
    if ratio <= SMALLEST_RATIO:
        raise RuleNotApplicable(
            f"{TITLE} PID",
            f"kappa = 1/(K Ku) must be above {SMALLEST_RATIO:g}, here it is {ratio:.3g}",
        )
    return PID(
        Kc=(0.3 - 0.1 * ratio**4) * point.Ku,
        Ti=0.6 * point.Pu / (1 + 2 * ratio),
        Td=0.15 * (1 - ratio) * point.Pu / (1 - 0.95 * ratio),
        action=point.action,
    )


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    _, ratio = _point_and_ratio(process)
    said = [SOURCE_TEXT["exact"]]
    if ratio < CHECKED_RATIO:
        said.append(
            f"kappa = 1/(K Ku) is {ratio:.3g}: its Ms of about 1.4 was checked from "
            f"{CHECKED_RATIO:g} on"
        )
    return tuple(said)


NAME = "amigo_frequency"
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Åström & Hägglund 2006, Advanced PID Control, from memory",
    status="memory",
    aim="the largest integral gain with Ms and Mt within 1.4",
    form="ISA",
    validity="PID: kappa = 1/(K Ku) above 0.2",
    structures=MappingProxyType(
        {
            "PI": without_speed(NAME, amigo_frequency_pi),
            "PID": without_speed(NAME, amigo_frequency_pid),
        }
    ),
    takes=MappingProxyType({"PI": ("FOPDT", "SOPDT", "IPDT"), "PID": ("FOPDT", "SOPDT")}),
    notes=_notes,
)
