"""Which loops oscillate together, and where that comes from: one list of suspects with reasons."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from historian.resampling import even_record
from loop.record import Record
from loop.signals import Flags, Real
from monitoring.cascade_pairs import CascadePair, cascade_pairs
from monitoring.nonlinearity import Nonlinearity, nonlinearity
from monitoring.oscillation import oscillation
from monitoring.shared_oscillations import SharedOscillation, shared_oscillations

# A gap of so many samples is bridged, as in an assessment; a loop with longer ones is left out.
LARGEST_GAP = 3.5
FEWEST_SAMPLES = 64
# Of a grid with more points than so many times the samples, nearly all would be invented.
MOST_POINTS = 20
# The first suspect must lead the next by this part of its index, or the order says nothing.
CLEAR_LEAD = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """One loop of a group that oscillates together.

    Attributes
    ----------
    tag : str
        The loop.
    nonlinearity : float or None
        Index of its error; the loop where the oscillation begins has the largest. [-]
    reason : str
        Why it stands where it stands.
    """

    tag: str
    nonlinearity: float | None
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OscillationGroup:
    """Loops that share an oscillation, and where it likely begins.

    Attributes
    ----------
    period : float
        Their period. [s]
    similarity : float
        Least similarity of two of them. [-]
    source : str or None
        Tag of the loop where it likely begins; None where the data do not say.
    reason : str
        What that rests on.
    suspects : tuple of Suspect
        All of them, the likeliest source first.
    """

    period: float
    similarity: float
    source: str | None
    reason: str
    suspects: tuple[Suspect, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cascade:
    """An outer loop whose output is an inner loop's set point.

    Attributes
    ----------
    outer, inner : str
        Tags.
    explained : float
        Part of the inner set point's moves that the outer output explains. [-]
    """

    outer: str
    inner: str
    explained: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantOscillations:
    """What loops have in common over one period.

    Attributes
    ----------
    groups : tuple of OscillationGroup
        The largest first.
    cascades : tuple of Cascade
        Pairs that were recognised.
    left_out : tuple of (str, str)
        Loops that could not be looked at, and why.
    """

    groups: tuple[OscillationGroup, ...]
    cascades: tuple[Cascade, ...]
    left_out: tuple[tuple[str, str], ...]


def plant_oscillations(records: Sequence[Record], *, seed: int = 0) -> PlantOscillations:
    """Group loops that oscillate together and rank where it comes from.

    Parameters
    ----------
    records : sequence of Record
        Routine data of several loops over the same period, each with its tag and start.
    seed : int
        Seed of the surrogates behind the non-linearity index.

    Raises
    ------
    ValueError
        Two records share a tag, or one has no start.
    """
    tags = [record.tag for record in records]
    if len({*tags}) != len(tags):
        raise ValueError("every loop may be given once")
    unfit = {record.tag: _unfit(record) for record in records}
    usable = [record for record in records if not unfit[record.tag]]
    left_out = [(tag, reason) for tag, reason in unfit.items() if reason]
    together = _together(usable)
    if together is None:
        left_out += [(record.tag, "no time in common with the others") for record in usable]
        return PlantOscillations(groups=(), cascades=(), left_out=tuple(left_out))
    dt, error, op, sp = together
    whole = _whole(error)
    left_out += [
        (record.tag, "no set point, or gaps that are too long")
        for record, good in zip(usable, whole, strict=True)
        if not good
    ]
    kept = [record.tag for record, good in zip(usable, whole, strict=True) if good]
    groups = _groups(_bridged(error[whole]), dt, kept, seed)
    every = [record.tag for record in usable]
    return PlantOscillations(
        groups=groups,
        cascades=tuple(_cascade(pair, every) for pair in cascade_pairs(op, sp)),
        left_out=tuple(left_out),
    )


def _unfit(record: Record) -> str:
    """Say why a loop cannot be put on a grid; empty where it can."""
    if len(record) < FEWEST_SAMPLES:
        return f"{len(record)} samples are fewer than {FEWEST_SAMPLES}"
    if record.span / record.sample_time > MOST_POINTS * len(record):
        return "samples far too uneven"
    return ""


def _together(records: Sequence[Record]) -> tuple[float, Real, Real, Real] | None:
    """Put the loops on one grid over the time that all of them cover: dt, error, OP, SP."""
    if len(records) < 2:
        return None
    if any(record.start is None for record in records):
        raise ValueError("loops are compared by the clock: every record needs its start")
    begin = [record.start.timestamp() for record in records if record.start is not None]
    dt = max(record.sample_time for record in records)
    start = max(begin)
    end = min(b + float(record.t[-1]) for b, record in zip(begin, records, strict=True))
    grid = np.arange(0.0, end - start, dt)
    if grid.size < FEWEST_SAMPLES:
        return None
    rows = []
    for b, record in zip(begin, records, strict=True):
        even = even_record(record, dt, max_gap=LARGEST_GAP * dt)
        # The nearest sample of the even grid: half a sample of shift at most.
        place = np.clip(np.round((grid + start - b - even.t[0]) / dt), 0, len(even) - 1)
        at = place.astype(np.int64)
        sp = np.full(grid.size, np.nan) if even.sp is None else even.sp[at]
        rows.append((sp - even.pv[at], even.op[at], sp))
    error, op, sp_ = (np.array(part) for part in zip(*rows, strict=True))
    return dt, error, op, sp_


def _whole(error: Real) -> Flags:
    """Tell which errors are known for at least nine tenths of the time."""
    return np.asarray(np.mean(np.isfinite(error), axis=1) >= 0.9)


def _bridged(error: Real) -> Real:
    places = np.arange(error.shape[1])
    return np.array(
        [np.interp(places, places[np.isfinite(row)], row[np.isfinite(row)]) for row in error]
    ).reshape(error.shape)


def _groups(error: Real, dt: float, tags: Sequence[str], seed: int) -> tuple[OscillationGroup, ...]:
    mains = [oscillation(row, dt, segments=False).main for row in error]
    periods = np.array([np.nan if main is None else main.period / dt for main in mains])
    if not error.size:
        return ()
    return tuple(
        _group(shared, error, dt, tags, seed) for shared in shared_oscillations(error, periods)
    )


def _group(
    shared: SharedOscillation, error: Real, dt: float, tags: Sequence[str], seed: int
) -> OscillationGroup:
    found = [
        (tags[member], nonlinearity(error[member], shared.period, seed=seed))
        for member in shared.members
    ]
    found.sort(key=lambda one: -np.inf if one[1].index is None else one[1].index, reverse=True)
    source, reason = _source(found)
    return OscillationGroup(
        period=shared.period * dt,
        similarity=shared.similarity,
        source=source,
        reason=reason,
        suspects=tuple(_suspect(tag, index) for tag, index in found),
    )


def _source(found: Sequence[tuple[str, Nonlinearity]]) -> tuple[str | None, str]:
    tag, first = found[0]
    if first.index is None or not first.significant:
        return None, (
            "No loop of the group is non-linear: a disturbance from outside, or a tuning that "
            "makes one of them swing."
        )
    second = found[1][1].index or 0.0
    if first.index - second < CLEAR_LEAD * first.index:
        return None, (
            f"{tag} and {found[1][0]} are non-linear alike ({first.index:.2f} and {second:.2f}); "
            "the order says nothing."
        )
    return tag, (
        f"{tag} is the most non-linear ({first.index:.2f}, next {second:.2f}); the process between "
        "loops filters the harmonics of what begins there. Check its valve first."
    )


def _suspect(tag: str, found: Nonlinearity) -> Suspect:
    if found.index is None:
        return Suspect(tag=tag, nonlinearity=None, reason=found.reason)
    word = "non-linear" if found.significant else "not distinguishable from a linear loop"
    return Suspect(tag=tag, nonlinearity=found.index, reason=word)


def _cascade(pair: CascadePair, tags: Sequence[str]) -> Cascade:
    return Cascade(outer=tags[pair.outer], inner=tags[pair.inner], explained=pair.explained)
