"""Find single readings far off their neighbours: faults of the reading, not the process."""

import numpy as np
from scipy.ndimage import binary_opening, median_filter

from loop.signals import Flags, Real

# Spikes of up to three readings, judged against five on either side.
LONGEST_SPIKE, WINDOW = 3, 11
# Six standard deviations: one good reading in 500 million of normal noise.
FAR = 6.0
# A spike is also far on the scale of the record; this spares the kinks of a record without noise.
SMALLEST = 0.01
# Beyond this part of the readings it is not spikes but what the noise is like.
MOST = 0.1


def find_spikes(residual: Real, pv: Real) -> Flags:
    """Mark readings that stand far off the running median of the residual, and PV off both sides.

    The residual of a fit is judged and not PV itself, so that a fast answer is not taken for a
    spike; against its running median, so that an error of the model is not either. The few readings
    between a move and a jump that the model has too early are off the model, but not off the
    readings before them.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        PV less model. [PV]
    pv : ndarray, shape (n,)
        The readings themselves, which tell range and resolution. [PV]
    """
    none = np.zeros(residual.size, dtype=np.bool_)
    if residual.size < 5 * WINDOW:
        return none
    off = np.abs(residual - median_filter(residual, WINDOW, mode="mirror"))
    steps = np.abs(np.diff(pv))
    resolution = float(np.median(steps[steps > 0])) if np.any(steps) else 0.0
    low, high = np.quantile(pv, [0.01, 0.99])
    # Readings that repeat hide the noise; half of their usual change is the least that it is.
    noise = max(1.4826 * float(np.median(off)), resolution / 2)
    least = max(FAR * noise, SMALLEST * float(high - low))
    far = off > least
    far &= ~binary_opening(far, np.ones(LONGEST_SPIKE + 1, dtype=np.bool_))
    far &= _on_both_sides(pv, far, least / 2)
    return far if np.count_nonzero(far) <= MOST * far.size else none


def _on_both_sides(pv: Real, flags: Flags, least: float) -> Flags:
    """Runs of flags in which PV stands off the reading before and off the one after."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    standing = np.zeros(flags.size, dtype=np.bool_)
    for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        outer = ((a, a - 1), (b - 1, b))
        standing[a:b] = all(
            abs(float(pv[inside] - pv[outside])) > least
            for inside, outside in outer
            if 0 <= outside < pv.size
        )
    return standing
