"""Search routine data for stretches that can tell a process from its disturbances.

In automatic the output answers PV. Only what somebody else did to the loop separates cause from
answer: a set-point move in automatic, an output move in manual, a switch between the two while PV
was off its set point.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from identification.even_record import EvenRecord
from identification.held_input import Indices
from loop.errors import PoorExcitation
from loop.signals import Flags, Real

# A normal sample lies within 0.6745 standard deviations half of the time.
MEDIAN_DEVIATION = 0.6745
# A move under twice what PV wanders by anyway tells less than it costs to look at.
LEAST_MOVE = 2.0
# Changes within so many rows of each other are one move, such as a ramp typed by an operator.
SAME_MOVE = 5
# Rows around a move: at least, and in times that PV needed to get there.
LEAST_BEFORE, LEAST_AFTER, BEFORE, AFTER = 30, 120, 3, 8
# PV has arrived when it is within this part of the move, or within its wander.
ARRIVED = 0.1
# Rows of all segments; the largest moves are kept.
MOST_ROWS, MOST_MOVES = 60_000, 400


class Excitation(StrEnum):
    """What somebody did to the loop."""

    SET_POINT = "set-point move in automatic"
    OUTPUT = "output move in manual"
    SWITCH = "switch between manual and automatic off the set point"


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """One thing done to the loop.

    Attributes
    ----------
    kind : Excitation
        What.
    first, last : int
        Rows where it shows first and where it is complete.
    size : float
        By how much, with its sign: set point or distance from it [PV], output [OP].
    """

    kind: Excitation
    first: int
    last: int
    size: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Rows first to last - 1, without a gap, with the moves in them."""

    first: int
    last: int
    moves: tuple[Move, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentSearch:
    """What a search found.

    Attributes
    ----------
    segments : tuple of Segment
        Informative stretches, in time.
    wander : float
        Standard deviation of PV about its set point while nobody did anything. [PV]
    small : int
        Moves that were too small beside the wander.
    hours : float
        Time in automatic. [h]
    """

    segments: tuple[Segment, ...]
    wander: float
    small: int
    hours: float

    @property
    def moves(self) -> tuple[Move, ...]:
        """All moves of all segments."""
        return tuple(move for segment in self.segments for move in segment.moves)


def find_segments(record: EvenRecord) -> SegmentSearch:
    """Find the informative stretches of a record.

    Parameters
    ----------
    record : EvenRecord
        Routine data.

    Raises
    ------
    PoorExcitation
        Nobody moved anything, or not by enough; with what is missing.
    """
    wander = _wander(record)
    found = [*_set_point_moves(record), *_output_moves(record), *_switches(record)]
    op_wander = _spread(np.diff(record.op[record.known]))
    large = [m for m in found if _large(m, wander, op_wander)]
    hours = float(np.count_nonzero(record.automatic & record.known)) * record.dt / 3600
    if not large:
        raise PoorExcitation(_missing(record, found, wander, hours))
    large.sort(key=lambda m: -abs(m.size))
    windows = sorted(
        (window for m in large[:MOST_MOVES] for window in _window(record, m, wander)),
        key=lambda w: w.first,
    )
    if not windows:
        raise PoorExcitation(
            f"Gaps leave fewer than {LEAST_BEFORE} rows after every one of {len(large)} moves."
        )
    return SegmentSearch(
        segments=_merged(windows), wander=wander, small=len(found) - len(large), hours=hours
    )


def _large(move: Move, wander: float, op_wander: float) -> bool:
    least = op_wander if move.kind is Excitation.OUTPUT else LEAST_MOVE * wander
    return abs(move.size) > max(least, 0.0)


def _wander(record: EvenRecord) -> float:
    """Robust standard deviation of PV about its set point, or about its neighbours in manual."""
    error = (record.pv - record.sp)[record.known & record.automatic]
    error = error[np.isfinite(error)]
    if error.size < LEAST_BEFORE:
        return _spread(np.diff(record.pv[record.known])) / 2**0.5
    return _spread(error)


def _spread(values: Real) -> float:
    if values.size == 0:
        return 0.0
    return float(np.median(np.abs(values - np.median(values)))) / MEDIAN_DEVIATION


def _groups(changed: Indices) -> Iterator[tuple[int, int]]:
    """First and last of changes that follow each other closely."""
    if changed.size:
        cuts = np.flatnonzero(np.diff(changed) > SAME_MOVE) + 1
        for part in np.split(changed, cuts):
            yield int(part[0]), int(part[-1])


def _set_point_moves(record: EvenRecord) -> list[Move]:
    sp, auto = record.sp, record.automatic & record.known
    both = auto[1:] & auto[:-1]
    with np.errstate(invalid="ignore"):
        changed = np.flatnonzero(both & (np.abs(np.diff(sp)) > 0)) + 1
    moves = []
    for first, last in _groups(changed):
        reach = sp[first - 1 : last + 1]
        size = float(reach[-1] - reach[0])
        if abs(size) < np.ptp(reach) / 2:  # there and back
            size = float(np.ptp(reach))
        moves.append(Move(kind=Excitation.SET_POINT, first=first, last=last, size=size))
    return moves


def _output_moves(record: EvenRecord) -> list[Move]:
    manual = ~record.automatic & record.known
    both = manual[1:] & manual[:-1]
    with np.errstate(invalid="ignore"):
        changed = np.flatnonzero(both & (np.abs(np.diff(record.op)) > 0)) + 1
    return [
        Move(
            kind=Excitation.OUTPUT,
            first=first,
            last=last,
            size=float(record.op[last] - record.op[first - 1]),
        )
        for first, last in _groups(changed)
    ]


def _switches(record: EvenRecord) -> list[Move]:
    switched = np.flatnonzero(np.diff(record.automatic.astype(int)) != 0) + 1
    moves = []
    for row in switched.tolist():
        error = float(record.pv[row] - record.sp[row])
        if record.automatic[row] and np.isfinite(error):
            moves.append(Move(kind=Excitation.SWITCH, first=row, last=row, size=error))
    return moves


def _window(record: EvenRecord, move: Move, wander: float) -> Iterator[Segment]:
    """Rows around a move, up to the nearest gaps; nothing where hardly any are left."""
    arrival = _arrival(record, move, wander)
    low = max(move.first - max(LEAST_BEFORE, BEFORE * arrival), 0)
    high = min(move.last + max(LEAST_AFTER, AFTER * arrival), record.rows)
    gaps: Flags = ~record.known
    before = np.flatnonzero(gaps[low : move.first])
    after = np.flatnonzero(gaps[move.first : high])
    low = low + int(before[-1]) + 1 if before.size else low
    high = move.first + int(after[0]) if after.size else high
    if high - move.first >= LEAST_BEFORE:
        yield Segment(first=low, last=high, moves=(move,))


def _arrival(record: EvenRecord, move: Move, wander: float) -> int:
    """Rows from the move until PV is first where it was to go."""
    ahead = slice(move.last, min(move.last + MOST_ROWS, record.rows))
    if move.kind is Excitation.OUTPUT:
        aim = record.pv[min(ahead.stop - 1, move.last + LEAST_AFTER)]
    else:
        aim = record.sp[move.last]
    near = np.abs(record.pv[ahead] - aim) < max(ARRIVED * abs(move.size), wander)
    return int(np.argmax(near)) if np.any(near) else near.size


def _merged(windows: list[Segment]) -> tuple[Segment, ...]:
    merged: list[Segment] = []
    for window in windows:
        if merged and window.first <= merged[-1].last:
            merged.append(_joined(merged.pop(), window))
        else:
            merged.append(window)
    kept: list[Segment] = []
    rows = 0
    for segment in sorted(merged, key=lambda s: -max(abs(m.size) for m in s.moves)):
        if not kept or rows + segment.last - segment.first <= MOST_ROWS:
            kept.append(segment)
            rows += segment.last - segment.first
    return tuple(sorted(kept, key=lambda s: s.first))


def _joined(a: Segment, b: Segment) -> Segment:
    moves = sorted({*a.moves, *b.moves}, key=lambda m: (m.first, m.kind))
    return Segment(first=a.first, last=max(a.last, b.last), moves=tuple(moves))


def _missing(record: EvenRecord, found: list[Move], wander: float, hours: float) -> str:
    """What was looked for, what was there, and what to do."""
    rows = np.count_nonzero(record.known)
    said = f"{rows} rows over {record.rows * record.dt / 3600:.3g} h, {hours:.3g} h in automatic: "
    if not np.any(np.isfinite(record.sp)) and not found:
        return (
            said + "the record has no set point and OP did not move in manual, so nothing tells "
            "the process from its disturbances. Export the set point too, or make an output step."
        )
    if found:
        most = max(found, key=lambda m: abs(m.size))
        said += (
            f"the largest of {len(found)} moves, a {most.kind}, is {most.size:+.3g} where PV "
            f"wanders by {wander:.3g} (standard deviation) by itself. "
        )
    else:
        said += "the set point stood still and OP did not move in manual. "
    return said + (
        "In a closed loop OP answers PV, and a model from that alone would be made of noise. Move "
        f"the set point by at least {5 * wander:.2g}, or make an output step in manual."
    )
