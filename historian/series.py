"""Bring a stream in order: sorted by time, duplicates merged, gaps measured."""

from dataclasses import dataclass

import numpy as np

from historian.streams import Instants, Integers, Values
from historian.timestamps import SECOND
from loop.record import Mode


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """Rows in order of time, each time once.

    Attributes
    ----------
    instants : ndarray, shape (n,)
        Nanoseconds since 1970 as int64, or elapsed seconds as float64; strictly increasing.
    values : dict of str to ndarray, shape (n,)
        Values by tag, NaN for gaps.
    duplicates : int
        Rows that were merged into another.
    conflicts : dict of str to int
        Cells of merged rows that differed, by tag.
    disordered : bool
        Whether rows had to be sorted.
    """

    instants: Instants
    values: dict[str, Values]
    duplicates: int
    conflicts: dict[str, int]
    disordered: bool


def in_order(instants: Instants, values: dict[str, Values]) -> Series:
    """Sort rows by time and merge those of the same time.

    Of rows with the same time, each tag keeps its last value in the file that is not a gap.
    """
    values = dict(values)
    disordered, newest_first = False, False
    if instants.size > 1:
        newest_first = bool(np.all(instants[1:] < instants[:-1]))
        disordered = not newest_first and bool(np.any(instants[1:] < instants[:-1]))
    if newest_first:
        instants = instants[::-1].copy()
        for tag in values:
            values[tag] = values[tag][::-1].copy()
    elif disordered:
        order = np.argsort(instants, kind="stable")
        instants = instants[order]
        for tag in values:
            values[tag] = values[tag][order]
    new = np.ones(instants.size, dtype=np.bool_)
    new[1:] = instants[1:] != instants[:-1]
    duplicates = int(instants.size - np.count_nonzero(new))
    conflicts: dict[str, int] = {}
    if duplicates:
        starts = np.flatnonzero(new)
        instants = instants[starts]
        for tag in values:
            values[tag], conflicts[tag] = _merged(values[tag], starts)
    return Series(
        instants=instants,
        values=values,
        duplicates=duplicates,
        conflicts=conflicts,
        disordered=disordered,
    )


def _merged(values: Values, starts: Integers) -> tuple[Values, int]:
    """Take the last value of every group that is no gap; count the others that differ from it."""
    modes = values.dtype == np.int8
    known = values != Mode.UNKNOWN if modes else np.isfinite(values)
    last = np.maximum.reduceat(np.where(known, np.arange(values.size), -1), starts)
    gap = np.array(Mode.UNKNOWN if modes else np.nan, dtype=values.dtype)
    merged = np.where(last >= 0, values[np.maximum(last, 0)], gap)
    sizes = np.diff(np.append(starts, values.size))
    conflicts = int(np.count_nonzero(known & (values != np.repeat(merged, sizes))))
    return merged, conflicts


@dataclass(frozen=True, slots=True, kw_only=True)
class Spacing:
    """How evenly rows lie in time.

    Attributes
    ----------
    sample_time : float
        Median spacing, 0 for fewer than two rows. [s]
    irregular : bool
        Whether more than a tenth of the spacings differ from the median by more than half.
    gaps : int
        Spacings over 1.5 medians, or over 10 medians where irregular.
    longest_gap : float
        Longest of them, 0 without any. [s]
    span : float
        From first to last row. [s]
    """

    sample_time: float
    irregular: bool
    gaps: int
    longest_gap: float
    span: float


def spacing_of(instants: Instants) -> Spacing:
    """Measure the spacing of rows in order."""
    if instants.size < 2:
        return Spacing(sample_time=0.0, irregular=False, gaps=0, longest_gap=0.0, span=0.0)
    second = SECOND if instants.dtype == np.int64 else 1
    steps = np.diff(instants)
    lower, upper = (steps.size - 1) // 2, steps.size // 2
    steps.partition((lower, upper))
    usual = (float(steps[lower]) + float(steps[upper])) / 2
    even = np.count_nonzero((steps >= 0.5 * usual) & (steps <= 1.5 * usual))
    irregular = bool((steps.size - even) * 10 > steps.size)
    limit = (10 if irregular else 1.5) * usual
    longest = float(steps.max())
    return Spacing(
        sample_time=usual / second,
        irregular=irregular,
        gaps=int(np.count_nonzero(steps > limit)),
        longest_gap=longest / second if longest > limit else 0.0,
        span=float(instants[-1] - instants[0]) / second,
    )
