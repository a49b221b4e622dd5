"""Average samples into buckets that are fine where a response can be and wide elsewhere."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from loop.signals import Real

Indices: TypeAlias = npt.NDArray[np.intp]

# The part of a move's share of buckets that goes to what is before the first.
BEFORE = 4


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
    ends = np.empty_like(starts)
    ends[:-1], ends[-1] = starts[1:], t.size
    total = (ends - starts).astype(np.float64)
    ends -= 1
    spread = t[ends]
    spread -= t[starts]
    spread *= spread
    spread *= (total + 1) / (12 * np.maximum(total - 1, 1))
    # About the first value, so that a large offset costs no digits.
    about = pv - pv[0]
    sums = np.add.reduceat(about, starts)
    means = sums / total
    scatter = max(float(about @ about) - float(sums @ means), 0.0)
    means += pv[0]
    times = np.add.reduceat(t, starts)
    times /= total
    return Samples(t=times, pv=means, weight=total, spread=spread, scatter=scatter)


def _bucket_starts(n: int, moved: Indices, at_most: int) -> Indices:
    """First sample of every bucket."""
    moves = sorted({i for i in moved.tolist() if i < n})
    share = at_most // (len(moves) + 1)
    if share < 20 or not moves:
        return np.linspace(0, n, at_most, endpoint=False).astype(np.intp)
    # Before the first move nothing happens that needs resolving.
    starts = [np.arange(share // BEFORE) * (moves[0] / (share // BEFORE))]
    rising = np.arange(share) * (1 / share)
    for first, end in pairwise([*moves, n]):
        starts.append(first + np.exp(rising * math.log(end - first)))
        starts[-1][0] = first  # and first + 1 is among the next
    together = np.concatenate(starts).astype(np.intp)
    # Whole numbers, each once; a move at the very last sample has no sample after it.
    new = np.empty(together.size, dtype=np.bool_)
    new[0] = True
    np.greater(together[1:], together[:-1], out=new[1:])
    new &= together < n
    return together[new]
