"""How a loop misses a profile: which limit, by how much, on which plant, in words."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from loop.margin_batch import MarginBatch
from loop.margins import Margins
from loop.signals import Flags, Real
from tuning.profiles import Profile
from tuning.sweep import Sweep

# Name of a margin in a sentence, and whether small values are the bad ones.
MARGIN_NAMES: Mapping[str, tuple[str, bool]] = MappingProxyType(
    {
        "gain": ("gain margin", True),
        "phase": ("phase margin", True),
        "delay": ("delay margin", True),
        "Ms": ("Ms", False),
        "Mt": ("Mt", False),
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A target that a loop misses, and the plant it is on.

    Attributes
    ----------
    target : str
        "stable", "gain", "phase", "Ms", "delay" or "Mt".
    value : float
        What the loop has there, in the unit of the margin; the number 0 for "stable".
    limit : float
        What the profile asks for, in the same unit.
    overrun : float
        How far the limit is broken, as a ratio above 1; infinite for an unstable loop. [-]
    parameter : str or None
        Parameter that is off, None at the model.
    factor : float
        Its factor, 1 at the model. [-]
    sentence : str
        All of it in words.
    """

    target: str
    value: float
    limit: float
    overrun: float
    parameter: str | None
    factor: float
    sentence: str


def profile_holds(sweep: Sweep, found: MarginBatch, profile: Profile) -> Flags:
    """Decide for each loop of a batch whether every limit of the profile holds.

    Parameters
    ----------
    sweep : Sweep
        Plants, shape (n,).
    found : MarginBatch, shape (m, n)
        Margins of m controllers on them.
    profile : Profile
        Limits on the margins.

    Returns
    -------
    ndarray of bool, shape (m, n)
    """
    holds = found.stable.copy()
    for name, limits in _limits(sweep, profile).items():
        values = getattr(found, name)
        holds &= values >= limits if MARGIN_NAMES[name][1] else values <= limits
    return np.asarray(holds)


def _limits(sweep: Sweep, profile: Profile) -> Mapping[str, Real]:
    """Limits by margin, one for each plant; a delay margin is held to its own plant's dead time."""
    one = np.ones(sweep.plants.shape)
    limits: dict[str, Real] = {
        "gain": profile.gain * one,
        "phase": profile.phase * one,
        "Ms": profile.Ms * one,
    }
    if profile.delay_over_theta is not None:
        limits["delay"] = profile.delay_over_theta * sweep.plants.theta
    if profile.Mt is not None:
        limits["Mt"] = profile.Mt * one
    return limits


def failures(
    sweep: Sweep, found: MarginBatch, holds: Flags, profile: Profile
) -> list[tuple[Failure | None, Failure | None]]:
    """Describe for each controller what gives way at the smallest error, and the gravest miss.

    Instability outranks every limit.

    Parameters
    ----------
    sweep : Sweep
        Plants, shape (n,) or more.
    found : MarginBatch, shape (m, n) or more
        Margins of m controllers on them.
    holds : ndarray of bool, shape (m, n)
        Whether the profile holds; only these first n plants are looked at.
    profile : Profile
        Limits on the margins.

    Returns
    -------
    list of tuple of Failure or None
        First and gravest failure of each controller; None where everything holds.
    """
    n = holds.shape[1]
    limits = {name: values[:n] for name, values in _limits(sweep, profile).items()}
    overruns = np.array(
        [_overrun(name, getattr(found, name)[:, :n], limit) for name, limit in limits.items()]
    )
    missed = overruns.max(axis=0)
    missed[~found.stable[:, :n]] = math.inf
    missed[holds] = -math.inf
    error = np.where(holds, math.inf, np.abs(sweep.factors[:n] - 1).max(axis=1, initial=0.0))
    error = error.round(9)
    smallest = error == error.min(axis=1, keepdims=True)
    first = np.argmax(np.where(smallest, missed, -math.inf), axis=1)
    gravest = np.argmax(missed, axis=1)

    def at(case: int, plant: int) -> Failure:
        parameter, factor = sweep.moved[plant]
        if not found.stable[case, plant]:
            return Failure(
                target="stable",
                value=0.0,
                limit=0.0,
                overrun=math.inf,
                parameter=parameter,
                factor=factor,
                sentence=f"the loop is unstable {sweep.where[plant]}",
            )
        row = int(np.argmax(overruns[:, case, plant]))
        name = tuple(limits)[row]
        value, limit = float(getattr(found, name)[case, plant]), float(limits[name][plant])
        return Failure(
            target=name,
            value=value,
            limit=limit,
            overrun=float(overruns[row, case, plant]),
            parameter=parameter,
            factor=factor,
            sentence=missed_limit(name, value, limit, sweep.where[plant]),
        )

    return [
        (None, None) if row.all() else (at(case, int(first[case])), at(case, int(gravest[case])))
        for case, row in enumerate(holds)
    ]


def _overrun(name: str, values: Real, limits: Real) -> Real:
    """How far limits are broken, as a ratio above 1 where they are. [-]"""
    if MARGIN_NAMES[name][1]:
        # Nothing is asked of a delay margin where there is no dead time.
        beyond = np.where(limits > 0, math.inf, 0.0) + np.zeros_like(values)
        return np.asarray(np.divide(limits, values, out=beyond, where=(limits > 0) & (values > 0)))
    return np.asarray(values / limits)


def missed_margins(found: Margins, profile: Profile, theta: float = 0.0) -> tuple[str, ...]:
    """Say which margins of one loop miss a profile; nothing where all hold.

    Parameters
    ----------
    found : Margins
        Margins of the loop.
    profile : Profile
        Limits on them.
    theta : float
        Dead time that a delay margin is held to. [s]
    """
    limits = {"gain": profile.gain, "phase": profile.phase, "Ms": profile.Ms}
    if profile.delay_over_theta is not None:
        limits["delay"] = profile.delay_over_theta * theta
    if profile.Mt is not None:
        limits["Mt"] = profile.Mt
    missed = []
    for name, limit in limits.items():
        value = getattr(found, name)
        if value < limit if MARGIN_NAMES[name][1] else value > limit:
            missed.append(missed_limit(name, value, limit))
    return tuple(missed)


def missed_limit(name: str, value: float, limit: float, where: str = "") -> str:
    """Say which margin misses its limit, by its numbers and the plant.

    Parameters
    ----------
    name : str
        Name of the margin.
    value, limit : float
        What it is, and what was asked for; they differ.
    where : str
        The plant in words.
    """
    title, small_is_bad = MARGIN_NAMES[name]
    digits = 4
    while f"{value:.{digits}g}" == f"{limit:.{digits}g}":  # they differ, so this ends
        digits += 1
    shown, asked = f"{value:.{digits}g}", f"{limit:.{max(digits, 4)}g}"
    if name == "gain":
        shown, asked = f"{shown} ({decibels(value)})", f"{asked} ({decibels(limit)})"
    unit = {"phase": "°", "delay": " s"}.get(name, "")
    subject, side = (f"the {title}", "below") if small_is_bad else (title, "above")
    place = f" {where}" if where else ""
    return f"{subject} is {shown}{unit}{place}, {side} {asked}{unit}"


def decibels(gain: float) -> str:
    """Print a gain margin in dB."""
    return f"{20 * math.log10(gain):.1f} dB" if gain else "-infinite dB"


def gain_margin_words(gain: float) -> str:
    """Print a gain margin as a ratio and in dB."""
    return f"{gain:.3g} ({decibels(gain)})" if gain < math.inf else "infinite"
