"""Find the moves of a controller output: steps, ramps and staircases, up and down.

The output may jitter, be quantised or carry measurement noise; only what stands out of that
counts as a move.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from identification.held_input import Indices
from loop.errors import NoStepFound
from loop.signals import Real

# A running median over 11 samples keeps edges where they are and takes out jitter and noise of up
# to five samples in a row.
MEDIAN_WINDOW = 11
# A normal sample is within 1.645 standard deviations 9 times of 10; the median absolute deviation
# is 0.6745 of them.
NINETIETH, MEDIAN_DEVIATION = 1.645, 0.6745
# Moves under a fiftieth of the whole range of the output are left in the input of a fit but are
# not called steps: their answer drowns in that of the others.
SMALLEST_MOVE = 0.02
# Resolution at which a ramp is followed.
FINEST = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One move of the output from a hold to a hold; a ramp is one move.

    Attributes
    ----------
    first, last : int
        Samples at which the move shows first and is complete.
    start, end : float
        Their times; equal for a step. [s]
    instant : float
        Where the move lies in time, the mean of its parts weighted by their size. [s]
    op_from, op_to : float
        Output before and after. [OP]
    """

    first: int
    last: int
    start: float
    end: float
    instant: float
    op_from: float
    op_to: float

    @property
    def size(self) -> float:
        """Change of the output. [OP]"""
        return self.op_to - self.op_from

    @property
    def direction(self) -> str:
        """Up or down."""
        return "up" if self.size > 0 else "down"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputMoves:
    """What the output did over a record.

    Attributes
    ----------
    steps : tuple of Step
        Moves that count as steps, in time.
    noise_sd : float
        Standard deviation of the jitter and noise about the holds. [OP]
    anchors : ndarray of int, shape (k,)
        Samples at which the output leaves the level of the last anchor by more than its noise.
    """

    steps: tuple[Step, ...]
    noise_sd: float
    anchors: Indices


def output_noise(op: Real) -> float:
    """Estimate the jitter of an output about its holds; 0 where it stands still between moves.

    The larger of the median absolute difference of neighbours and the 90th percentile of the
    distance from a running median, each as a standard deviation. [OP]

    Parameters
    ----------
    op : ndarray, shape (n,)
        Output. [OP]
    """
    if op.size < 3 * MEDIAN_WINDOW:
        return 0.0
    about_median = np.abs(op - _smooth(op))
    neighbours = float(np.median(np.abs(np.diff(op)))) / MEDIAN_DEVIATION / math.sqrt(2)
    noise = max(neighbours, float(np.quantile(about_median, 0.9)) / NINETIETH)
    # A fast test signal also sits away from its running median; but unlike noise its levels
    # survive that median.
    quiet_range = float(np.ptp(_smooth(op)))
    return 0.0 if noise > np.ptp(op) / 10 and quiet_range > 0.75 * np.ptp(op) else noise


def find_moves(t: Real, op: Real, op_before: float | None = None) -> OutputMoves:
    """Find the moves of an output.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    op : ndarray, shape (n,)
        Output, without gaps. [OP]
    op_before : float, optional
        Output before the first sample. Where the first sample differs from it, the output moved
        at the first sample. [OP]

    Raises
    ------
    NoStepFound
        The output stands still, only jitters, or wanders without ever holding.
    """
    noise = output_noise(op)
    ahead = 0
    if op_before is not None:
        ahead = MEDIAN_WINDOW
        op = np.concatenate((np.full(ahead, op_before), op))
        spacing = float(np.median(np.diff(t))) if t.size > 1 else 1.0
        t = np.concatenate((t[0] - spacing * np.arange(ahead, 0, -1.0), t))
    quiet = _smooth(op) if noise else op
    span = float(np.ptp(quiet))
    if span == 0 or span < 4 * noise:
        raise NoStepFound(_standing_still(op, noise, op_before))
    anchors, levels = _follow(quiet, max(FINEST * span, 2 * noise))
    groups = _group(t, np.diff(levels), anchors, span)
    smallest = max(SMALLEST_MOVE * span, 3 * noise)
    kept = [g for g in groups if abs(levels[g[1] + 1] - levels[g[0]]) >= smallest]
    if not kept:
        raise NoStepFound(
            f"OP wanders over {span:.3g} without a move of at least {smallest:.3g} at a time, so "
            "no answer can be read from the record."
        )
    steps = _measure(t, op, anchors, levels, kept)
    return OutputMoves(
        steps=tuple(_shift(step, ahead) for step in steps),
        noise_sd=noise,
        anchors=np.maximum(anchors - ahead, 0),
    )


def _smooth(op: Real) -> Real:
    return np.asarray(median_filter(op, MEDIAN_WINDOW, mode="nearest"))


def _standing_still(op: Real, noise: float, op_before: float | None) -> str:
    level = float(np.median(op))
    if noise:
        return (
            f"OP only jitters about {level:.4g}: its quiet range is {np.ptp(_smooth(op)):.3g} "
            f"against a noise of {noise:.3g}."
        )
    if op_before is not None:
        return f"OP stands at {level:.4g} throughout, which is also the OP before the first row."
    return (
        f"There is no move in OP, it stands at {level:.4g} throughout. If the output moved just "
        "before the first row, say so with --op-before."
    )


def _follow(op: Real, tolerance: float) -> tuple[Indices, Real]:
    """Samples that leave the last level by more than the tolerance, and the levels they take."""
    changed = np.flatnonzero(np.diff(op)) + 1
    level = float(op[0])
    anchors, levels = [], [level]
    for i, value in zip(changed.tolist(), op[changed].tolist(), strict=True):
        if abs(value - level) > tolerance:
            level = value
            anchors.append(i)
            levels.append(level)
    return np.array(anchors, dtype=np.intp), np.array(levels)


def _group(t: Real, parts: Real, anchors: Indices, span: float) -> list[tuple[int, int]]:
    """First and last anchor of every move: parts of a ramp follow each other in one direction.

    Parts on neighbouring samples always belong together. Small ones also do when the pause between
    them is under a fiftieth of the record, as in a ramp made of quantised increments.
    """
    spacing = float(np.median(np.diff(t)))
    times = t[anchors]
    groups = [(0, 0)]
    for k in range(1, anchors.size):
        pause = times[k] - times[k - 1]
        together = pause < 3.5 * spacing or (
            pause < (t[-1] - t[0]) / 50 and max(abs(parts[k]), abs(parts[k - 1])) < span / 5
        )
        if together and parts[k] * parts[k - 1] > 0:
            groups[-1] = (groups[-1][0], k)
        else:
            groups.append((k, k))
    return groups


def _measure(
    t: Real,
    op: Real,
    anchors: Indices,
    levels: Real,
    groups: list[tuple[int, int]],
) -> list[Step]:
    firsts = [int(anchors[g[0]]) for g in groups]
    lasts = [int(anchors[g[1]]) for g in groups]
    edges = [0, *lasts], [*firsts, op.size]
    holds = [float(np.median(op[a:b])) for a, b in zip(*edges, strict=True)]
    steps = []
    for i, (a, b) in enumerate(groups):
        parts = np.diff(levels[a : b + 2])
        steps.append(
            Step(
                first=firsts[i],
                last=lasts[i],
                start=float(t[firsts[i]]),
                end=float(t[lasts[i]]),
                instant=float(parts @ t[anchors[a : b + 1]] / parts.sum()),
                op_from=holds[i],
                op_to=holds[i + 1],
            )
        )
    return steps


def _shift(step: Step, ahead: int) -> Step:
    """Count samples from the record's own first one again."""
    return replace(step, first=max(step.first - ahead, 0), last=max(step.last - ahead, 0))
