"""Margins of many loops at once, with exact dead time."""

import math
from collections.abc import Callable
from dataclasses import fields

import numpy as np
import numpy.typing as npt

from loop.batch import MarginBatch, PIDBatch, ProcessBatch, common_shape
from loop.errors import UnstableLoop
from loop.factors import FactoredLoop, polynomial_roots
from loop.falling_batch import falling_margins
from loop.lag_loops import LagLoops
from loop.margins import Margins, loop_margins
from loop.process import LARGEST
from loop.scan_batch import scan_margins
from loop.signals import Flags

__all__ = ["MarginBatch", "batch_margins"]

# Loops at a time: their scans fit the cache and memory stays bounded.
CHUNK = 512
# Falling loops take far less, and a tuning request for a first-order process (some 2,100 loops)
# goes through at once.
FALLING_CHUNK = 2200
NAMES = tuple(item.name for item in fields(MarginBatch))
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
        A sample time lies outside 0 to 1e9 s.
    """
    hold = np.asarray(sample_time, dtype=float) / 2
    if not np.all((hold >= 0) & (hold <= LARGEST / 2)):
        raise ValueError(f"sample_time must lie within 0 and {LARGEST:g} s everywhere")
    shape = common_shape(processes.shape, controllers.shape, hold.shape)
    found = _margins(LagLoops.of(processes, controllers, hold, shape))
    return MarginBatch(**{name: getattr(found, name).reshape(shape) for name in NAMES})


def _margins(loops: LagLoops) -> MarginBatch:
    found, proven = _in_chunks(loops, falling_margins, FALLING_CHUNK)
    if proven.all():
        return found
    # One scan for all of them: its first few loops cost as much as the next hundred.
    rest = np.flatnonzero(~proven)
    part = loops.take(rest)
    scanned, _ = _in_chunks(part, lambda some: (scan_margins(some), np.zeros(0, dtype=bool)), CHUNK)
    for name in NAMES:
        getattr(found, name)[rest] = getattr(scanned, name)
    # Without dead time a gain that never falls ends on the real axis: rare, and left to the scalar.
    for row in rest[(part.theta == 0) & (part.excess <= 0)]:
        one = _one(loops, int(row))
        found.stable[row] = one is not UNSTABLE
        for name in NAMES[1:]:
            getattr(found, name)[row] = getattr(one, name)
    return found


def _in_chunks(
    loops: LagLoops, work: Callable[[LagLoops], tuple[MarginBatch, Flags]], chunk: int
) -> tuple[MarginBatch, Flags]:
    """Do the work for some loops at a time and put the parts together."""
    if loops.size <= chunk:
        return work(loops)
    starts = range(0, loops.size, chunk)
    parts = [work(loops.take(slice(first, first + chunk))) for first in starts]
    found = {
        name: np.concatenate([getattr(margins, name) for margins, _ in parts]) for name in NAMES
    }
    return MarginBatch(**found), np.concatenate([flags for _, flags in parts])


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
