"""Margins of a loop known by its response while its parameters are off, one at a time.

What `tuning.verification` is to a PID on a process: here for predictors and cascades, whose loops
have no poles and zeros to list.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from loop.errors import UnstableLoop
from loop.margins import Margins
from tuning.profiles import Profile
from tuning.shortfall import gain_margin_words, missed_margins
from tuning.sweep import FACTORS

UNSTABLE = Margins(gain=0.0, gain_reduction=0.0, phase=0.0, delay=0.0, Ms=math.inf, Mt=math.inf)
DEAD_TIME = "theta"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseSweep:
    """What a loop keeps while the process is not its model.

    Attributes
    ----------
    nominal : Margins
        At the model.
    parameters : mapping of str to float
        Parameters at the model that were moved; one that is 0 is not there. [s] or [PV/OP]
    factors : tuple of float
        Factors on one parameter of the process at a time. [-]
    swept : dict of tuple of Margins
        By parameter, at every factor; an unstable loop has margins 0 and Ms infinite.
    worst_Ms : float
        Largest Ms of all. [-]
    worst : str
        Where that is.
    """

    nominal: Margins
    parameters: Mapping[str, float]
    factors: tuple[float, ...]
    swept: dict[str, tuple[Margins, ...]]
    worst_Ms: float
    worst: str


def sweep_response(
    margins_of: Callable[[Mapping[str, float]], Margins],
    parameters: Mapping[str, float],
    *,
    factors: tuple[float, ...] = FACTORS,
) -> ResponseSweep:
    """Move one parameter at a time.

    Parameters
    ----------
    margins_of : callable
        Margins for the parameters by name; raises UnstableLoop.
    parameters : mapping of str to float
        Parameters at the model.
    factors : tuple of float
        Factors on one parameter; 0.5 to 1.5 in eleven steps if not given. [-]

    Raises
    ------
    UnstableLoop
        The loop is unstable at the model.
    """
    nominal = margins_of(parameters)
    there = {name: value for name, value in parameters.items() if value}

    def at(name: str, factor: float) -> Margins:
        if factor == 1:
            return nominal
        try:
            return margins_of({**parameters, name: parameters[name] * factor})
        except UnstableLoop:
            return UNSTABLE

    swept = {name: tuple(at(name, factor) for factor in factors) for name in there}
    worst_Ms, worst = max(
        (found.Ms, f"{name} x {factor:.2g}")
        for name, row in swept.items()
        for factor, found in zip(factors, row, strict=True)
    )
    return ResponseSweep(
        nominal=nominal,
        parameters=there,
        factors=factors,
        swept=swept,
        worst_Ms=worst_Ms,
        worst=worst,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepVerdict:
    """Whether a loop keeps a profile over its sweep.

    Attributes
    ----------
    passes : bool
        Whether every limit holds at the model and with each parameter off.
    sentence : str
        The verdict with its numbers; where it fails, the smallest error at which it does.
    missed : str
        What is missed at that error; empty where nothing is.
    """

    passes: bool
    sentence: str
    missed: str = ""


def judge_sweep(sweep: ResponseSweep, profile: Profile) -> SweepVerdict:
    """Hold a sweep to a profile.

    Parameters
    ----------
    sweep : ResponseSweep
        Margins while the parameters are off.
    profile : Profile
        Limits on the margins.
    """
    dead_time = sum(v for name, v in sweep.parameters.items() if name.endswith(DEAD_TIME))
    plants = [("", 1.0, sweep.nominal)]
    plants += sorted(
        (
            (name, factor, found)
            for name, row in sweep.swept.items()
            for factor, found in zip(sweep.factors, row, strict=True)
        ),
        key=lambda plant: round(abs(plant[1] - 1), 9),
    )
    for name, factor, found in plants:
        more = (factor - 1) * sweep.parameters[name] if name.endswith(DEAD_TIME) else 0.0
        missed = missed_margins(found, profile, dead_time + more)
        if missed:
            where = f"with {name} x {factor:.2g}" if name else "at the model"
            # A loop that is lost has no margins to miss.
            said = f"{missed[0]} {where}" if found.gain else f"the loop is unstable {where}"
            sentence = f"Fails the {profile.name} profile: {said}."
            return SweepVerdict(passes=False, sentence=sentence, missed=said)
    gain, phase = (min(getattr(found, name) for *_, found in plants) for name in ("gain", "phase"))
    return SweepVerdict(
        passes=True,
        sentence=f"Passes the {profile.name} profile for ±50 % of each parameter; worst cases: "
        f"gain margin {gain_margin_words(gain)}, phase margin {phase:.3g}°, "
        f"Ms {sweep.worst_Ms:.3g} with {sweep.worst}.",
    )
