"""Average samples into buckets that are fine where a response can be and wide elsewhere."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from loop.signals import Real

Indices: TypeAlias = npt.NDArray[np.intp]

# Fine averages: samples kept alone on either side of an arrival, growth of the averages after it,
# and their number before the first.
ALONE, WIDENING, EQUAL = 12, 0.04, 40


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
    """

    t: Real
    pv: Real
    weight: Real | None


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
    if weight is None:
        total = _counts(starts, t.size)
        return Samples(
            t=np.add.reduceat(t, starts) / total,
            pv=np.add.reduceat(pv, starts) / total,
            weight=total,
        )
    total = np.add.reduceat(weight, starts)
    return Samples(
        t=np.add.reduceat(t * weight, starts) / total,
        pv=np.add.reduceat(pv * weight, starts) / total,
        weight=total,
    )


def _counts(starts: Indices, n: int) -> Real:
    """Samples from each start to the next."""
    counts = np.empty(starts.size)
    counts[:-1] = starts[1:] - starts[:-1]
    counts[-1] = n - starts[-1]
    return counts


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
    return _increasing(starts)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FineAverages:
    """Averages that a fit can rest on, since what averaging does to them is known.

    Attributes
    ----------
    t, pv, weight : ndarray, shape (n,)
        Mean times [s], mean process values [PV] and number of readings [-].
    spread : ndarray, shape (n,)
        Variance of the times of the readings, as of evenly spaced ones. [s^2]
    scatter : float
        Sum of the squares of the readings about their means. [PV^2]
    """

    t: Real
    pv: Real
    weight: Real
    spread: Real
    scatter: float


def condense_finely(t: Real, pv: Real, arrivals: Real) -> FineAverages:
    """Average samples so little that an answer which arrives at known times loses nothing.

    Around an arrival, where the answer has a corner, samples stay alone; after it the averages
    widen with the time since.

    Parameters
    ----------
    t, pv : ndarray, shape (n,)
        Times [s] and process values [PV], without gaps.
    arrivals : ndarray, shape (m,)
        Times at which an answer begins, increasing. [s]
    """
    starts = _fine_starts(t.size, np.searchsorted(t, arrivals).tolist())
    weight = _counts(starts, t.size)
    mean_t, sums = np.add.reduceat(t, starts) / weight, np.add.reduceat(pv, starts)
    length = t[starts + weight.astype(np.intp) - 1] - t[starts]
    # About the first value, so that a large offset costs no digits.
    about = pv - pv[0]
    centred = sums - weight * pv[0]
    return FineAverages(
        t=mean_t,
        pv=sums / weight,
        weight=weight,
        spread=length**2 * (weight + 1) / (12 * np.maximum(weight - 1, 1)),
        scatter=float(about @ about) - float(centred @ (centred / weight)),
    )


def _fine_starts(n: int, arrived: list[int]) -> Indices:
    firsts = sorted({max(i - ALONE, 0) for i in arrived if i < n})
    starts: list[Real] = [np.arange(EQUAL) * ((firsts[0] if firsts else n) / EQUAL)]
    for first, end in zip(firsts, [*firsts[1:], n], strict=True):
        count = max(int(math.log((end - first) / (2 * ALONE)) / WIDENING), 0)
        widening = first + 2 * ALONE * np.exp(WIDENING * np.arange(count))
        starts += [np.arange(float(first), min(first + 2 * ALONE, end)), widening]
    return _increasing(starts)
