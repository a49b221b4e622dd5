"""Loops that oscillate together: the same period, and spectra of the same shape around it."""

from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.signal import detrend
from scipy.spatial.distance import squareform

from loop.signals import Real

# Periods of one cause agree to a bin of the spectrum, or to this part where the bins are finer.
SAME_PERIOD = 0.05
# Cosine between two amplitude spectra in the band; independent loops that happen to share a period
# stay well below, because their amplitudes wander differently.
SIMILAR = 0.9
BAND = 2**0.5
FEWEST_CYCLES = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedOscillation:
    """Loops that oscillate together.

    Attributes
    ----------
    members : tuple of int
        Places of the loops, in the order given.
    period : float
        Their period, the mean by power. [samples]
    similarity : float
        Least similarity of two members. [-]
    """

    members: tuple[int, ...]
    period: float
    similarity: float


def shared_oscillations(errors: Real, periods: Real) -> tuple[SharedOscillation, ...]:
    """Group loops whose oscillations belong together, the largest group first.

    The similarity of two loops is the cosine between their amplitude spectra in the band of an
    octave around the mean of their periods, own choice after the spectral correlation of the field
    (definition from memory). Groups are joined from the most alike upwards as long as every pair in
    a group is similar (complete linkage), so that a chain of half-alike loops makes no group.

    Parameters
    ----------
    errors : ndarray, shape (m, n)
        Control errors of m loops at the same instants, without gaps.
    periods : ndarray, shape (m,)
        Period of the strongest oscillation of each loop, NaN where it has none. [samples]

    Returns
    -------
    tuple of SharedOscillation
        Groups of two and more.
    """
    loops = np.flatnonzero(np.isfinite(periods) & (periods * FEWEST_CYCLES <= errors.shape[1]))
    if loops.size < 2:
        return ()
    spectra = _spectra(errors[loops])
    alike = _similarities(spectra, periods[loops], errors.shape[1])
    groups = fcluster(linkage(squareform(1.0 - alike), "complete"), 1.0 - SIMILAR, "distance")
    found = []
    for group in np.unique(groups):
        inside = np.flatnonzero(groups == group)
        if inside.size < 2:
            continue
        power = np.var(errors[loops[inside]], axis=1)
        found.append(
            SharedOscillation(
                members=tuple(int(place) for place in loops[inside]),
                period=float(np.average(periods[loops[inside]], weights=power)),
                similarity=float(np.min(alike[np.ix_(inside, inside)])),
            )
        )
    return tuple(sorted(found, key=lambda one: -len(one.members)))


def _spectra(errors: Real) -> Real:
    """Amplitude spectra of errors that were freed of their trend and scaled."""
    free = detrend(errors, axis=1)
    spread = np.std(free, axis=1, keepdims=True)
    window = np.hanning(errors.shape[1])
    # What the straight line leaves of an error that does not move is rounding, not a signal.
    moves = spread > 1e-12 * np.max(np.abs(errors), axis=1, keepdims=True)
    scaled = np.divide(free, spread, out=np.zeros_like(free), where=moves)
    return np.abs(np.fft.rfft(scaled * window, axis=1))


def _similarities(spectra: Real, periods: Real, n: int) -> Real:
    m = periods.size
    alike = np.eye(m)
    for i in range(m):
        for j in range(i):
            period = (periods[i] + periods[j]) / 2
            resolution = period / n  # one bin, as a part of the period
            if abs(periods[i] - periods[j]) > max(SAME_PERIOD, resolution) * period:
                continue
            low, high = int(n / period / BAND), int(np.ceil(n / period * BAND)) + 1
            a, b = spectra[i, low:high], spectra[j, low:high]
            size = float(np.linalg.norm(a) * np.linalg.norm(b))
            alike[i, j] = alike[j, i] = min(float(a @ b) / size, 1.0) if size > 0 else 0.0
    return alike
