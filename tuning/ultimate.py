"""The ultimate point: the gain at which the loop just oscillates, and the period of it."""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from scipy.optimize import brentq

from loop.controller import Action
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, SOPDT, Process

UltimateSource: TypeAlias = Literal["exact", "describing function"]

SOURCE_TEXT: dict[UltimateSource, str] = {
    "exact": "Ku and Pu are exact: from the model with its dead time as it is",
    "describing function": (
        "Ku and Pu come from a relay test by describing function, which on a first-order process "
        "misses Ku by -19 % (theta/tau 0.05) to +22 % (theta/tau 10)"
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class UltimatePoint:
    """Ultimate gain and period, and how they were found.

    Attributes
    ----------
    Ku : float
        Gain of a P controller that makes the loop oscillate steadily, positive. [OP/PV]
    Pu : float
        Period of that oscillation. [s]
    action : Action
        Direction of the controller that has this gain.
    source : str
        "exact" (from a model) or "describing function" (from a relay test).
    """

    Ku: float
    Pu: float
    action: Action = Action.REVERSE
    source: UltimateSource = "describing function"

    def __post_init__(self) -> None:
        for name, value in (("Ku", self.Ku), ("Pu", self.Pu)):
            if not (value > 0 and math.isfinite(value)):
                raise ValueError(f"{name} must be positive, got {value}")


def ultimate_point(process: Process, *, rule: str = "The ultimate point") -> UltimatePoint:
    """Find the ultimate gain and period of a process, exactly.

    At w180 the phase, with the dead time as it is, reaches -180°:
    n pi/2 + atan(w tau1) + atan(w tau2) + w theta = pi, with n integrators. Then
    Ku = 1/|G(j w180)| and Pu = 2 pi/w180.

    Parameters
    ----------
    process : FOPDT, SOPDT or IPDT
        Process model. [s]
    rule : str
        Who asks, for the sentence of a refusal.

    Raises
    ------
    RuleNotApplicable
        The phase never reaches -180° (no dead time on one or two lags), or it is there at every
        frequency (a double integrator), or the process has another type.

    Examples
    --------
    >>> point = ultimate_point(FOPDT(K=2.0, tau=120.0, theta=30.0))
    >>> f"{point.Ku:.3f} {point.Pu:.1f} {point.source}"
    '3.467 109.9 exact'
    """
    lags: tuple[float, ...]
    match process:
        case FOPDT(tau=tau):
            lags, integrators = (tau,), 0
        case SOPDT(tau1=tau1, tau2=tau2):
            lags, integrators = (tau1, tau2), 0
        case IPDT():
            lags, integrators = (), 1
        case _:
            raise RuleNotApplicable(
                rule,
                "the ultimate point is known for FOPDT, SOPDT or IPDT, "
                f"not for {type(process).__name__}",
            )
    theta = process.theta
    if theta == 0:
        raise RuleNotApplicable(
            rule, "without dead time the phase of this process never reaches -180°"
        )
    # x = w theta keeps the unknown within 0 and pi whatever the unit of time.
    start = integrators * math.pi / 2 - math.pi

    def beyond(x: float) -> float:
        return start + x + sum(math.atan(x * lag / theta) for lag in lags)

    x = brentq(beyond, 0.0, -start, xtol=1e-18, rtol=1e-15) if lags else -start
    w180 = x / theta
    size = w180**integrators * math.prod(math.hypot(1.0, w180 * lag) for lag in lags)
    return UltimatePoint(
        Ku=size / abs(process.K),
        Pu=2 * math.pi / w180,
        action=Action.for_gain(process.K),
        source="exact",
    )


def ultimate_notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001 - one signature for all rules
    """Say where Ku and Pu of a model come from."""
    return (SOURCE_TEXT["exact"],)
