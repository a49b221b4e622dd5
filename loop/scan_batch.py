"""Margins of many loops at once, whatever their shape, from a scan of the whole axis.

The cuts are those of one loop: between extremes of |L|, extremes of its phase and gain crossovers
both are monotone. Stability is Nyquist's count, read off the phase at the gain crossovers alone.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from loop.batch import MarginBatch
from loop.bracket_solver import EXTREME, FINEST, solve_brackets
from loop.crossovers import ASYMPTOTE, POINTS_A_DECADE, near_turns
from loop.lag_loops import LagLoops
from loop.margins import LARGEST_LOG_GAIN
from loop.signals import Flags, Real
from loop.stability import ON_THE_AXIS, ROUNDING

Rows: TypeAlias = npt.NDArray[np.intp]

TURN = 2 * math.pi
# From the end of a stretch nearest |L| = 1 to the other: even, and dense at that end.
# Summits between points below this part of the highest point stay below it.
PROMISING = 0.3
SAMPLES = np.unique(np.concatenate([np.linspace(0.0, 1.0, 13), 2.0 ** -np.arange(4, 44.0, 3)]))


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Frequencies that belong to loops: loop `row[i]` at `w[i]`."""

    row: Rows
    w: Real


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
    """Ascending frequencies of every loop, shape (n, m), and which of them end a stretch."""

    w: Real
    cut: Flags

    def with_points(self, points: _Points, *, cut: bool) -> "_Axis":
        """Sort further frequencies in; rows with fewer of them repeat their last frequency."""
        if not points.row.size:
            return self
        rows = self.w.shape[0]
        counts = np.bincount(points.row, minlength=rows)
        place = np.arange(points.row.size) - (np.cumsum(counts) - counts)[points.row]
        added = np.repeat(self.w[:, -1:], counts.max(), axis=1)
        added[points.row, place] = points.w
        flags = np.zeros(added.shape, dtype=bool)
        flags[points.row, place] = cut
        w = np.concatenate([self.w, added], axis=1)
        order = np.argsort(w, axis=1, kind="stable")
        flags = np.take_along_axis(np.concatenate([self.cut, flags], axis=1), order, axis=1)
        return _Axis(np.take_along_axis(w, order, axis=1), flags)


def scan_margins(loops: LagLoops) -> MarginBatch:
    """Find the margins of loops whose gain falls below 1 at high frequency or that have dead time.

    Parameters
    ----------
    loops : LagLoops
        Open loops, shape (n,); each has more poles than zeros, or as many and dead time.
    """
    axis = _with_turns(loops, LagLoops.gain_slope, _start(loops), cut=True)
    wc = _solve(loops, LagLoops.log_gain, axis.w)
    stable = _stable(loops, axis, wc)
    gain, gain_reduction = np.zeros(loops.size), np.zeros(loops.size)
    phase, delay = np.zeros(loops.size), np.zeros(loops.size)
    Ms, Mt = np.full(loops.size, math.inf), np.full(loops.size, math.inf)
    if np.any(stable):
        kept, axis, wc = _keep(stable, loops, axis, wc)
        phase[stable], delay[stable] = _phase_and_delay(kept, wc)
        axis = axis.with_points(wc, cut=True)
        axis = _with_turns(kept, LagLoops.phase_slope, axis, cut=False)
        runs = _runs(kept, axis)
        gain[stable], gain_reduction[stable] = _gain(kept, runs)
        Ms[stable], Mt[stable] = _peaks(kept, axis, runs)
    return MarginBatch(
        stable=stable,
        gain=gain,
        gain_reduction=gain_reduction,
        phase=phase,
        delay=delay,
        Ms=Ms,
        Mt=Mt,
    )


def _with_turns(
    loops: LagLoops, slope: Callable[[LagLoops, Real], Real], axis: _Axis, *, cut: bool
) -> _Axis:
    """Sort in where a slope changes its sign."""
    near = _Points(*near_turns(axis.w, slope(loops.columns(), axis.w)))
    axis = axis.with_points(near, cut=False)
    return axis.with_points(_solve(loops, slope, axis.w, EXTREME), cut=cut)


def _keep(
    stable: Flags, loops: LagLoops, axis: _Axis, wc: _Points
) -> tuple[LagLoops, _Axis, _Points]:
    if np.all(stable):
        return loops, axis, wc
    number = np.cumsum(stable) - 1
    left = stable[wc.row]
    points = _Points(number[wc.row[left]], wc.w[left])
    return loops.take(np.flatnonzero(stable)), _Axis(axis.w[stable], axis.cut[stable]), points


def _start(loops: LagLoops) -> _Axis:
    """Even points in ln w from asymptote to asymptote, and more about a notch or a resonance."""
    with np.errstate(divide="ignore"):
        corners: list[Real] = [1 / T for T in (*loops.lags, loops.theta, loops.b, np.sqrt(loops.c))]
        corners.append(np.where(loops.c > 0, loops.b, math.inf) / np.where(loops.c, loops.c, 1.0))
        corners += [1 / np.abs(T) for T in loops.leads]
        corners += [1 / np.sqrt(c) for _, c in loops.swings]
        corners.append(_asymptote(loops.log_k, loops.order))
        corners.append(_asymptote(loops.log_k_high, loops.excess))
    table = np.stack(corners)
    given = np.isfinite(table)
    low = np.log(np.min(table, axis=0, where=given, initial=math.inf) / ASYMPTOTE)
    high = np.log(np.max(table, axis=0, where=given, initial=0.0) * ASYMPTOTE)
    decades = float(np.max(high - low, initial=0.0)) / math.log(10)
    part = np.linspace(0.0, 1.0, 2 + math.ceil(decades * POINTS_A_DECADE))
    w = np.exp(low[:, None] + (high - low)[:, None] * part)
    axis = _Axis(w, np.zeros(w.shape, dtype=bool))
    for width, square in ((loops.b, loops.c), *loops.swings):
        height = 2 * np.sqrt(square)
        notch = np.flatnonzero(width < 0.7 * height)
        if not notch.size:
            continue
        ratio = (0.25 * width[notch] / height[notch])[:, None]
        offsets = ratio * (0.9 / ratio) ** np.linspace(0.0, 1.0, 40)
        centre = 1 / np.sqrt(square[notch, None])
        near = np.concatenate([centre * (1 - offsets), centre * (1 + offsets)], axis=1)
        rows = np.repeat(notch, near.shape[1])
        axis = axis.with_points(_Points(rows, near.ravel()), cut=False)
    return axis


def _asymptote(log_size: Real, slope: Real) -> Real:
    """Where a straight line of the Bode plot passes 1; infinite for a level one. [rad/s]"""
    crossing = np.exp(np.clip(log_size / np.where(slope, slope, 1.0), -230.0, 230.0))
    return np.where(slope != 0, crossing, math.inf)


def _solve(
    loops: LagLoops, f: Callable[[LagLoops, Real], Real], w: Real, resolution: float = FINEST
) -> _Points:
    """Every frequency where f changes its sign between neighbours of w, shape (n, m)."""
    positive = f(loops.columns(), w) >= 0
    row, col = np.nonzero(positive[:, 1:] != positive[:, :-1])
    if not row.size:
        return _Points(row, np.zeros(0))
    part = loops.take(row)
    left, right = w[row, col], w[row, col + 1]
    return _Points(row, solve_brackets(lambda x: f(part, x), left, right, resolution=resolution))


def _stable(loops: LagLoops, axis: _Axis, wc: _Points) -> Flags:
    """Nyquist's count: arg(1 + L) follows arg L to the nearest full turn where |L| = 1."""
    part = loops.take(wc.row)
    phase = part.phase(wc.w)
    leaving = np.where(part.gain_slope(wc.w) < 0, 1.0, -1.0)
    turns = np.bincount(wc.row, leaving * np.round(phase / TURN), minlength=loops.size)
    starts_reversed = (loops.sign < 0) & (loops.columns().log_gain(axis.w[:, :1])[:, 0] >= 0)
    distance = np.abs(np.mod(phase, TURN) - math.pi)
    on_axis = np.bincount(wc.row, distance < ON_THE_AXIS, minlength=loops.size) > 0
    at_origin = (loops.order == 0) & (loops.sign < 0) & (np.abs(loops.log_k) < ROUNDING)
    endless = (loops.excess == 0) & (loops.log_k_high > -ROUNDING)
    return np.asarray((-2 * turns - starts_reversed == 0) & ~on_axis & ~at_origin & ~endless)


def _phase_and_delay(loops: LagLoops, wc: _Points) -> tuple[Real, Real]:
    turn = np.mod(loops.take(wc.row).phase(wc.w) + math.pi, TURN)
    phase, delay = np.full(loops.size, math.inf), np.full(loops.size, math.inf)
    np.minimum.at(phase, wc.row, np.minimum(turn, TURN - turn))
    np.minimum.at(delay, wc.row, turn / wc.w)
    return np.degrees(phase), delay


@dataclass(frozen=True, slots=True, eq=False)
class _Runs:
    """Stretches of monotone |L| on one side of 1: run i of loop `row[i]`.

    It reaches from its end nearest |L| = 1 to `end`, the first phase crossover or the other end.
    `number[k, j]` is the run that point j of loop k lies in.
    """

    row: Rows
    anchor: Real
    end: Real
    crosses: Flags
    number: Rows


def _runs(loops: LagLoops, axis: _Axis) -> _Runs:
    columns = loops.columns()
    size, phase = np.abs(columns.log_gain(axis.w)), columns.phase(axis.w)
    starts = axis.cut.copy()
    starts[:, 0], starts[:, -1] = True, False
    row, first = np.nonzero(starts)
    ends = axis.cut.copy()
    ends[:, 0], ends[:, -1] = False, True
    last = np.nonzero(ends)[1]
    rising = size[row, first] <= size[row, last]
    anchor, far = np.where(rising, first, last), np.where(rising, last, first)
    end, crosses = axis.w[row, far], np.zeros(row.size, dtype=bool)
    turn = np.floor((phase + math.pi) / TURN)
    cell_row, cell = np.nonzero(turn[:, 1:] != turn[:, :-1])
    number = (np.cumsum(starts.ravel()) - 1).reshape(starts.shape)
    run = number[cell_row, cell]
    order = np.lexsort((np.where(rising[run], cell, -cell), run))
    run, at = np.unique(run[order], return_index=True)
    cell = cell[order][at]
    near, away = np.where(rising[run], (cell, cell + 1), (cell + 1, cell))
    here, there = turn[row[run], near], turn[row[run], away]
    level = TURN * (here + (there > here)) - math.pi
    part = loops.take(row[run])
    end[run] = solve_brackets(
        lambda x: np.asarray(part.phase(x) - level),
        axis.w[row[run], cell],
        axis.w[row[run], cell + 1],
    )
    crosses[run] = True
    return _Runs(row, axis.w[row, anchor], end, crosses, number)


def _gain(loops: LagLoops, runs: _Runs) -> tuple[Real, Real]:
    """Gain margin and gain reduction from every phase crossover, both ends of the axis included."""
    rows = [runs.row[runs.crosses]]
    sizes = [loops.take(rows[0]).log_gain(runs.end[runs.crosses])]
    for flags, size in (
        ((loops.order == 0) & (loops.sign < 0), loops.log_k),
        (loops.excess == 0, loops.log_k_high),
    ):
        rows.append(np.flatnonzero(flags))
        sizes.append(size[flags])
    row, inverse = np.concatenate(rows), np.exp(-np.clip(np.concatenate(sizes), -700.0, 700.0))
    gain, gain_reduction = np.full(loops.size, math.inf), np.zeros(loops.size)
    above, below = inverse > 1, inverse < 1
    np.minimum.at(gain, row[above], inverse[above])
    np.maximum.at(gain_reduction, row[below], inverse[below])
    return gain, gain_reduction


def _peaks(loops: LagLoops, axis: _Axis, runs: _Runs) -> tuple[Real, Real]:
    """Ms and Mt: at the ends of the axis, or where a slope turns from rising to falling."""
    low = _limits(loops.sign, loops.log_k, loops.order)
    high = _limits(-np.ones(loops.size), loops.log_k_high, -loops.excess)
    peaks = np.maximum(low, high)
    anchor, end = runs.anchor[:, None], runs.end[:, None]
    samples = np.clip(anchor + (end - anchor) * SAMPLES, *np.sort((anchor, end), axis=0))
    brackets = []
    for row, w, seen in (
        (np.arange(loops.size), axis.w, _inside(axis, runs)),
        (runs.row, samples, np.ones(samples.shape, dtype=bool)),
    ):
        for which, (size, rise) in enumerate(_both_sensitivities(loops.take(row).columns(), w)):
            np.maximum.at(peaks[which], row, np.max(size, axis=1, where=seen, initial=0.0))
            brackets.append(_brackets(which, row, w, seen, size, rise, peaks[which]))
    of, row, left, right = (np.concatenate(column) for column in zip(*brackets, strict=True))
    part, way = loops.take(row), np.where(of == 0, 1.0, -1.0)
    at = solve_brackets(
        lambda x: _sensitivity(_polar(part, x), way)[1], left, right, resolution=EXTREME
    )
    np.maximum.at(peaks.ravel(), of * loops.size + row, _sensitivity(_polar(part, at), way)[0])
    return peaks[0], peaks[1]


def _inside(axis: _Axis, runs: _Runs) -> Flags:
    """Points between the anchor of some run and its end."""
    low, high = np.minimum(runs.anchor, runs.end), np.maximum(runs.anchor, runs.end)
    return np.asarray((axis.w >= low[runs.number]) & (axis.w <= high[runs.number]))


def _brackets(
    which: int, row: Rows, w: Real, seen: Flags, size: Real, rise: Real, peak: Real
) -> tuple[Rows, Rows, Real, Real]:
    """Neighbours of w with a high summit between them: of S or T, loop, from where, to where."""
    high = size > PROMISING * peak[row][:, None]
    near = seen[:, :-1] & seen[:, 1:] & (high[:, :-1] | high[:, 1:])
    line, col = np.nonzero(near & (np.sign(rise[:, :-1]) * np.sign(rise[:, 1:]) < 0))
    left, right = np.sort((w[line, col], w[line, col + 1]), axis=0)
    return np.full(line.size, which), row[line], left, right


def _polar(loops: LagLoops, w: Real) -> tuple[Real, Real, Real, Real, Real]:
    """|L|, cosine and sine of its phase, and the slopes of ln|L| and of the phase over ln w."""
    r = np.exp(np.clip(loops.log_gain(w), -LARGEST_LOG_GAIN, LARGEST_LOG_GAIN))
    phase = loops.phase(w)
    return r, np.cos(phase), np.sin(phase), loops.gain_slope(w), loops.phase_slope(w)


def _both_sensitivities(loops: LagLoops, w: Real) -> tuple[tuple[Real, Real], tuple[Real, Real]]:
    polar = _polar(loops, w)
    return _sensitivity(polar, np.ones(1)), _sensitivity(polar, -np.ones(1))


def _sensitivity(polar: tuple[Real, Real, Real, Real, Real], way: Real) -> tuple[Real, Real]:
    """|S| (way 1) or |T| (way -1), and a number with the sign of its slope.

    |T| is |S| with 1/L for L.
    """
    r, cos, sin, gain_slope, phase_slope = polar
    r = np.where(way > 0, r, 1 / r)
    size = 1 / np.hypot(1 + r * cos, r * sin)
    return size, phase_slope * sin - way * gain_slope * (cos + r)


def _limits(sign: Real, log_size: Real, growth: Real) -> Real:
    """|S| and |T|, shape (2, n), where |L| grows without bound, vanishes or stays at `log_size`."""
    L = sign * np.exp(np.clip(log_size, -LARGEST_LOG_GAIN, LARGEST_LOG_GAIN))
    level = growth == 0
    distance = np.where(level, np.abs(1 + L), 1.0)
    S = np.where(level, 1 / distance, np.where(growth > 0, 0.0, 1.0))
    T = np.where(level, np.abs(L) / distance, np.where(growth > 0, 1.0, 0.0))
    return np.stack([S, T])
