"""Average samples into buckets that are fine where a response can be and wide elsewhere."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from loop.signals import Real


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
        total = np.diff(starts, append=t.size).astype(float)
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


def _bucket_starts(n: int, moved: npt.NDArray[np.intp], at_most: int) -> npt.NDArray[np.intp]:
    """First sample of every bucket."""
    moves = sorted({int(i) for i in moved if i < n})
    share = at_most // (len(moves) + 1)
    if share < 20 or not moves:
        return np.linspace(0, n, at_most, endpoint=False).astype(np.intp)
    # Before the first move nothing happens that needs resolving.
    starts = [np.linspace(0, moves[0], share // 2, endpoint=False)]
    for first, end in zip(moves, [*moves[1:], n], strict=True):
        widening = np.exp(np.arange(share) * (math.log(end - first) / share))
        starts.append(np.append(first, first + widening))
    edges = np.concatenate(starts).astype(np.intp)
    return np.unique(edges)
