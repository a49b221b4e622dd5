"""Kappa-tau settings from a first-order model, for a largest sensitivity Ms of 1.4 or 2.

Source: K. J. Åström and T. Hägglund, PID Controllers: Theory, Design, and Tuning, 2nd ed., ISA,
1995. The original was not read; the constants are as quoted by one public source, and the margins
they lead to were computed here. The last constant of b for the PID with Ms 2 has a sign in doubt
(-0.051 in that source, +0.051 from memory); it moves b by 5 % at most.

Range: the constants were fitted on processes of higher order. On a true first-order process with
little dead time the PID is unsafe: at theta/tau = 0.25 the design for Ms 1.4 has Ms 3.5 with an
ideal derivative and 4.3 with N = 10, that for Ms 2 is unstable with N = 10; at theta/tau = 0.1
both are unstable.
"""

from dataclasses import dataclass
from math import exp
from types import MappingProxyType
from typing import TypeAlias

from loop.controller import PID, Action
from loop.process import FOPDT, Process
from tuning.rule import Rule, accept, dead_time_ratio, one_of, without_speed

TITLE = "Kappa-tau"
Curve: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Curves:
    """Constants a0, a1, a2 of one structure and design, for a0 exp(a1 t + a2 t^2).

    Attributes
    ----------
    gain : tuple of float
        K Kc theta/tau. [-]
    Ti, Td : tuple of float
        Ti/theta and Td/theta; Td is None for PI. [-]
    b : tuple of float
        Set-point weight. [-]
    """

    gain: Curve
    Ti: Curve
    b: Curve
    Td: Curve | None = None


PI_14 = Curves(gain=(0.29, -2.7, 3.7), Ti=(8.9, -6.6, 3.0), b=(0.81, 0.73, 1.9))
PI_20 = Curves(gain=(0.78, -4.1, 5.7), Ti=(8.9, -6.6, 3.0), b=(0.44, 0.78, -0.45))
PID_14 = Curves(
    gain=(3.8, -8.4, 7.3), Ti=(5.2, -2.5, -1.4), Td=(0.89, -0.37, -4.1), b=(0.4, 0.18, 2.8)
)
PID_20 = Curves(
    gain=(8.4, -9.6, 9.8), Ti=(3.2, -1.5, -0.93), Td=(0.86, -1.9, -0.44), b=(0.22, 0.65, -0.051)
)
# A set-point weight above 1 is beyond what the weights were introduced for.
LARGEST_WEIGHT = 1.0


def _at(curve: Curve, t: float) -> float:
    a0, a1, a2 = curve
    return a0 * exp(a1 * t + a2 * t * t)


def kappa_tau_settings(process: Process, curves: Curves) -> PID:
    """Tune a controller from the relative dead time t = theta/(theta + tau).

    K Kc theta/tau, Ti/theta, Td/theta and b are each a0 exp(a1 t + a2 t^2); b at most 1.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    curves : Curves
        Constants of the structure and of the design.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = kappa_tau_settings(FOPDT(K=1.0, tau=1.0, theta=1.0), PI_14)
    >>> round(pid.Kc, 4), round(pid.Ti, 4), pid.b
    (0.1896, 0.6949, 1.0)
    """
    model, r = dead_time_ratio(process, TITLE)
    t = model.theta / (model.theta + model.tau)
    return PID(
        Kc=_at(curves.gain, t) / (abs(model.K) * r),
        Ti=_at(curves.Ti, t) * model.theta,
        Td=_at(curves.Td, t) * model.theta if curves.Td else 0.0,
        b=min(_at(curves.b, t), LARGEST_WEIGHT),
        action=Action.for_gain(model.K),
    )


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    accept(process, FOPDT, TITLE)
    if structure != "PID":
        return ()
    return (
        "not safe where the process is truly first order with little dead time: the design for "
        "Ms 1.4 has Ms 4.3 at theta/tau 0.25 and is unstable at 0.1; go by the margins given here",
    )


def _rule(name: str, Ms: float, pi: Curves, pid: Curves) -> Rule:
    return Rule(
        name=name,
        title=f"{TITLE} (Ms {Ms})",
        source="Åström & Hägglund 1995, PID Controllers: Theory, Design, and Tuning",
        status="confirmed",
        aim=f"fast rejection of loads with a largest sensitivity Ms of {Ms}",
        form="ISA",
        validity="fitted on processes of higher order; the PID is unsafe on a true first order",
        structures=MappingProxyType(
            {
                "PI": without_speed(name, one_of(kappa_tau_settings, pi)),
                "PID": without_speed(name, one_of(kappa_tau_settings, pid)),
            }
        ),
        takes=MappingProxyType(dict.fromkeys(("PI", "PID"), ("FOPDT",))),
        notes=_notes,
    )


KAPPA_TAU_RULES = (
    _rule("kappa_tau_14", 1.4, PI_14, PID_14),
    _rule("kappa_tau_20", 2.0, PI_20, PID_20),
)
