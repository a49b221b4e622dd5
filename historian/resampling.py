"""Signals on an even grid and on few points, honest about holds and gaps.

A historian stores a controller output when it changes and a process variable when it has moved
enough: between two samples an output, set point or mode was held, a process variable was on its
way. Where two neighbours are too far apart nobody knows, and nothing is invented.

A sample without a value (NaN) carries no information: it may be of bad quality, or only stand
there because another signal was stamped at that instant. What makes a gap is the distance between
neighbours that have a value.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from loop.record import Mode, Record
from loop.signals import Real

Between: TypeAlias = Literal["previous", "linear", "mean"]

USUAL_SHARE = 0.95
USUAL_FACTOR = 1.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """A signal over time.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Strictly increasing times. [s]
    values : ndarray, shape (n,)
        Values, NaN in gaps.
    """

    t: Real
    values: Real


def usual_gap(t: Real, values: Real) -> float:
    r"""Say how far apart neighbours may be before a plot should show a gap.

    .. math:: gap = 1.5 \, q_{95}(\Delta t)

    One lost sample of an even record shows, and the unequal steps of exception reporting do not.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    values : ndarray, shape (n,)
        Values, NaN where there is none.

    Returns
    -------
    float
        1.5 times the distance that 95 % of the neighbours with a value keep; infinite for fewer
        than two. [s]

    Examples
    --------
    >>> usual_gap(np.arange(100.0), np.ones(100))
    1.5
    """
    steps = np.diff(t[~np.isnan(values)])
    return USUAL_FACTOR * float(np.quantile(steps, USUAL_SHARE)) if steps.size else math.inf


def resample(
    t: Real,
    values: Real,
    step: float,
    *,
    hold: Between,
    max_gap: float,
    start: float | None = None,
    end: float | None = None,
) -> Series:
    """Put a signal on an even grid.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Strictly increasing times. [s]
    values : ndarray, shape (n,)
        Values, NaN where there is none.
    step : float
        Spacing of the grid. [s]
    hold : {"previous", "linear", "mean"}
        What the signal did between two samples. "previous": it kept its value, as an output, set
        point or mode does. "linear": it went straight from one to the next. "mean": as "linear",
        but where samples lie within half a step of a grid point their mean stands for it, which
        keeps noise from folding into slow signals and shifts nothing in time.
    max_gap : float
        Greatest distance of neighbours with a value that is bridged; infinite for a signal that is
        only stored when it changes. Between neighbours farther apart every value is NaN. [s]
    start, end : float, optional
        First point of the grid, and the time up to which it reaches. Default: the first and last
        sample. Before the first value and after the last one every value is NaN. [s]

    Raises
    ------
    ValueError
        The step or the gap is not positive, or the times do not increase.

    Examples
    --------
    >>> resample(np.array([0.0, 3.0]), np.array([1.0, 4.0]), 1.0, hold="linear", max_gap=3.0).values
    array([1., 2., 3., 4.])
    >>> resample(np.array([0.0, 3.0]), np.array([1.0, 4.0]), 1.0, hold="linear", max_gap=2.0).values
    array([ 1., nan, nan,  4.])
    """
    _refuse_disorder(t, values)
    if not (step > 0 and math.isfinite(step)):
        raise ValueError(f"step must be positive, got {step}")
    if not max_gap > 0:
        raise ValueError(f"max_gap must be positive, got {max_gap}")
    if not t.size:
        raise ValueError("there is no sample to put on a grid")
    first = float(t[0]) if start is None else start
    last = float(t[-1]) if end is None else end
    # a last point that misses the end by rounding alone belongs to the grid
    points = math.floor((last - first) / step + 1e-9) + 1 if last >= first else 0
    grid = first + step * np.arange(points)
    known = ~np.isnan(values)
    on_grid = _between(grid, t[known], values[known], step, hold=hold, max_gap=max_gap)
    if hold == "mean":
        _put_means(on_grid, t[known], values[known], first, step)
    return Series(t=grid, values=on_grid)


def _between(
    grid: Real, t: Real, values: Real, step: float, *, hold: Between, max_gap: float
) -> Real:
    """Read a signal at grid points, NaN outside its samples and within its gaps."""
    on_grid = np.full(grid.size, np.nan)
    if not t.size:
        return on_grid
    near = max(1e-9 * step, 4 * float(np.spacing(np.max(np.abs(t)))))
    before = np.searchsorted(t, grid + near, side="right") - 1
    inside = (before >= 0) & (grid <= t[-1] + near)
    left = before[inside]
    right = np.minimum(left + 1, t.size - 1)
    width = t[right] - t[left]
    way = grid[inside] - t[left]
    on_sample = way <= near
    found = values[left]
    if hold != "previous":
        share = np.divide(way, width, out=np.zeros_like(way), where=~on_sample)
        found = (1 - share) * found + share * values[right]
        # rounding must not carry a value past both of its neighbours
        lower, upper = (
            np.minimum(values[left], values[right]),
            np.maximum(values[left], values[right]),
        )
        found = np.where(on_sample, values[left], np.clip(found, lower, upper))
    on_grid[inside] = np.where(on_sample | (width <= max_gap), found, np.nan)
    return on_grid


def _put_means(on_grid: Real, t: Real, values: Real, first: float, step: float) -> None:
    """Replace grid points that have samples within half a step by the mean of those."""
    nearest = np.floor((t - first) / step + 0.5)
    near = (nearest >= 0) & (nearest < on_grid.size)
    nearest, values = nearest[near].astype(np.int64), values[near]
    starts = np.flatnonzero(np.r_[True, np.diff(nearest) > 0][: nearest.size])
    if not starts.size:
        return
    counts = np.diff(np.r_[starts, nearest.size])
    opening = values[starts]
    means = opening + np.add.reduceat(values - np.repeat(opening, counts), starts) / counts
    lower, upper = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    places = nearest[starts]
    bridged = ~np.isnan(on_grid[places])
    on_grid[places[bridged]] = np.clip(means, lower, upper)[bridged]


def even_record(
    record: Record,
    step: float,
    *,
    max_gap: float,
    pv: Literal["linear", "mean"] = "mean",
    held_gap: float | None = None,
) -> Record:
    """Put a record on an even grid: PV on its way between samples; OP, SP and mode held.

    Parameters
    ----------
    record : Record
        Record with uneven times or gaps.
    step : float
        Spacing of the grid. [s]
    max_gap : float
        Greatest distance of PV samples that is bridged. [s]
    pv : {"mean", "linear"}
        How PV gets onto the grid, as in `resample`.
    held_gap : float, optional
        The same for OP, SP and mode; infinite where the historian stores them only when they
        change. Default: `max_gap`. [s]
    """
    longest = max_gap if held_gap is None else held_gap

    def held(values: Real) -> Real:
        return resample(record.t, values, step, hold="previous", max_gap=longest).values

    even = resample(record.t, record.pv, step, hold=pv, max_gap=max_gap)
    mode = None
    if record.mode is not None:
        known = np.where(record.mode == Mode.UNKNOWN, np.nan, record.mode.astype(np.float64))
        mode = np.nan_to_num(held(known), nan=float(Mode.UNKNOWN)).astype(np.int8)
    return replace(
        record,
        t=even.t,
        pv=even.values,
        op=held(record.op),
        sp=None if record.sp is None else held(record.sp),
        mode=mode,
    )


def _refuse_disorder(t: Real, values: Real) -> None:
    if t.shape != values.shape or t.ndim != 1:
        raise ValueError(f"times and values must be as long, got {t.shape} and {values.shape}")
    if np.any(np.diff(t) <= 0) or np.any(~np.isfinite(t)):
        raise ValueError("times must be finite and increase strictly")
