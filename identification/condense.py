"""Average samples into buckets that are fine where a response can be and wide elsewhere."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from loop.signals import Real

Indices: TypeAlias = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """Process values with the number of readings behind each.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times, of a bucket the mean of its readings. [s]
    pv : ndarray, shape (n,)
        Process values, of a bucket the mean of its readings. [PV]
    weight : ndarray, shape (n,), or None
        Readings behind each value; None for one each. [-]
    spread : ndarray, shape (n,), or None
        Variance of the times of those readings, as of evenly spaced ones; None where none were
        averaged or they were averages before. [s^2]
    scatter : float
        Sum of the squares of the readings about their averages. [PV^2]
    """

    t: Real
    pv: Real
    weight: Real | None
    spread: Real | None = None
    scatter: float = 0.0


def condense(
    t: Real, pv: Real, instants: Real, *, at_most: int, weight: Real | None = None
) -> Samples:
    """Average samples into buckets, each move starting its own.

    After a move the buckets widen in proportion to the time since it: a lag's answer is then
    resolved equally well whether it takes seconds or hours. A record with very many moves gets
    buckets of equal numbers of samples.

    Parameters
    ----------
    t, pv : ndarray, shape (n,)
        Times [s] and process values [PV], without gaps.
    instants : ndarray, shape (m,)
        Times of the moves, increasing. [s]
    at_most : int
        About the largest number of buckets; with no more samples than that they stay as they are.
    weight : ndarray, shape (n,), optional
        Readings behind each sample. Default: one. [-]
    """
    if t.size <= at_most:
        return Samples(t=t, pv=pv, weight=weight)
    starts = _bucket_starts(t.size, np.searchsorted(t, instants), at_most)
    if weight is not None:
        total = np.add.reduceat(weight, starts)
        return Samples(
            t=np.add.reduceat(t * weight, starts) / total,
            pv=np.add.reduceat(pv * weight, starts) / total,
            weight=total,
        )
    total, last = np.empty(starts.size), np.empty(starts.size)
    total[:-1], total[-1] = starts[1:] - starts[:-1], t.size - starts[-1]
    last[:-1], last[-1] = t[starts[1:] - 1], t[-1]
    # About the first value, so that a large offset costs no digits.
    about = pv - pv[0]
    sums = np.add.reduceat(about, starts)
    means = sums / total
    return Samples(
        t=np.add.reduceat(t, starts) / total,
        pv=means + pv[0],
        weight=total,
        spread=(last - t[starts]) ** 2 * (total + 1) / (12 * np.maximum(total - 1, 1)),
        scatter=max(float(about @ about) - float(sums @ means), 0.0),
    )


def _increasing(starts: list[Real]) -> Indices:
    """Whole numbers of all, in order, each once."""
    together = np.concatenate(starts).astype(np.intp)
    new = np.ones(together.size, dtype=np.bool_)
    np.greater(together[1:], together[:-1], out=new[1:])
    return together[new]


def _bucket_starts(n: int, moved: Indices, at_most: int) -> Indices:
    """First sample of every bucket."""
    moves = sorted({i for i in moved.tolist() if i < n})
    share = at_most // (len(moves) + 1)
    if share < 20 or not moves:
        return np.linspace(0, n, at_most, endpoint=False).astype(np.intp)
    # Before the first move nothing happens that needs resolving.
    starts: list[Real] = [np.arange(share // 2) * (moves[0] / (share // 2))]
    rising = np.arange(share) / share
    for first, end in zip(moves, [*moves[1:], n], strict=True):
        starts += [np.array([first]), first + float(end - first) ** rising]
    whole = _increasing(starts)
    # A move at the very last sample has no sample after it.
    return whole[whole < n]
