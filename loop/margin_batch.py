"""Margins of many loops at once, with exact dead time."""

import math
from dataclasses import fields

import numpy as np
import numpy.typing as npt

from loop.batch import MarginBatch, PIDBatch, ProcessBatch
from loop.errors import UnstableLoop
from loop.factors import FactoredLoop, polynomial_roots
from loop.falling_batch import falling_margins
from loop.lag_loops import LagLoops
from loop.margins import Margins, loop_margins
from loop.scan_batch import scan_margins

__all__ = ["MarginBatch", "batch_margins"]

# Loops at a time: their scans fit the cache and memory stays bounded.
CHUNK = 512
UNSTABLE = Margins(gain=0.0, gain_reduction=0.0, phase=0.0, delay=0.0, Ms=math.inf, Mt=math.inf)


def batch_margins(
    processes: ProcessBatch, controllers: PIDBatch, *, sample_time: npt.ArrayLike = 0.0
) -> MarginBatch:
    """Find the margins of every loop of a batch, as `loop.margins.margins` does for one.

    Parameters
    ----------
    processes : ProcessBatch
        Process models.
    controllers : PIDBatch
        Controllers; the shapes of both broadcast.
    sample_time : array_like
        Scan time h of the controllers; the hold adds h/2 of dead time. [s]

    Raises
    ------
    ValueError
        A sample time is negative or not finite.
    """
    hold = np.asarray(sample_time, dtype=float) / 2
    if not np.all(np.isfinite(hold) & (hold >= 0)):
        raise ValueError("sample_time must be 0 or positive and finite everywhere")
    shape = np.broadcast_shapes(processes.shape, controllers.shape, hold.shape)
    loops = LagLoops.of(processes, controllers, hold)
    found = [
        _margins(loops.take(np.arange(first, min(first + CHUNK, loops.size))))
        for first in range(0, max(loops.size, 1), CHUNK)
    ]
    return MarginBatch(
        **{
            item.name: np.concatenate([getattr(part, item.name) for part in found]).reshape(shape)
            for item in fields(MarginBatch)
        }
    )


def _margins(loops: LagLoops) -> MarginBatch:
    found, proven = falling_margins(loops)
    rest = np.flatnonzero(~proven)
    if rest.size:
        scanned = scan_margins(loops.take(rest))
        for item in fields(MarginBatch):
            getattr(found, item.name)[rest] = getattr(scanned, item.name)
    # Without dead time a gain that never falls ends on the real axis: rare, and left to the scalar.
    for row in np.flatnonzero((loops.theta == 0) & (loops.excess <= 0)):
        one = _one(loops, int(row))
        found.stable[row] = one is not UNSTABLE
        for item in fields(Margins):
            getattr(found, item.name)[row] = getattr(one, item.name)
    return found


def _one(loops: LagLoops, row: int) -> Margins:
    zeros = np.trim_zeros(np.array([loops.c[row], loops.b[row], 1.0]), "f")
    lags = [T[row] for T in loops.lags if T[row] > 0]
    poles = np.concatenate([np.zeros(int(loops.order[row])), [-1 / T for T in lags]])
    loop = FactoredLoop(
        sign=float(loops.sign[row]),
        log_k=float(loops.log_k_high[row]),
        zeros=polynomial_roots(tuple(zeros)),
        poles=poles.astype(complex),
        theta=float(loops.theta[row]),
    )
    try:
        return loop_margins(loop)
    except UnstableLoop:
        return UNSTABLE
