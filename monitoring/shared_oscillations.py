"""Loops that oscillate together: they keep step at one period, or their spectra are alike."""

from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.signal import detrend
from scipy.spatial.distance import squareform

from loop.signals import Real
from monitoring.phase_locking import phase_locking

# A swing that wanders is read at another period in every loop: how much, noise and the way to the
# loop decide. Whether loops keep step is what tells; the periods only have to lie within the line
# of a stretch, whose half width this is.
SAME_PERIOD = 0.4
# Coherence of loops that make a group, see the method's page; it is also to exceed what one pair
# of independent loops in a thousand reaches.
IN_STEP = 0.7
CHANCE = 1e-3
# A loop without an oscillation of its own feels the group's from this coherence on.
FELT = 0.25
FELT_BY_CHANCE = 1e-4
# Where the record is too short for that: periods agree to 5 % or a bin, and so do the spectra.
SAME_PERIOD_SHORT = 0.05
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
        Their period, the median. [samples]
    similarity : float
        Least similarity of two members: coherence, in a short record that of their spectra. [-]
    """

    members: tuple[int, ...]
    period: float
    similarity: float


def shared_oscillations(errors: Real, periods: Real) -> tuple[SharedOscillation, ...]:
    """Group loops whose oscillations belong together, the largest group first.

    Two loops belong together where they keep step: their coherence over stretches of four cycles
    is high, at the period of the one and at that of the other. Loops that happen to share a period
    drift apart. A record of fewer than a dozen cycles cannot show that; there the cosine between
    their amplitude spectra decides, in the octave around the period. Groups are joined from the
    most alike upwards as long as every pair in a group is alike (complete linkage), so that a chain
    of half-alike loops makes no group.

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
    alike = _alike(errors[loops], periods[loops])
    # Distances are shares of the limit, so that one limit holds for both measures.
    groups = fcluster(linkage(squareform(_distances(alike)), "complete"), 1.0, "distance")
    found = []
    for group in np.unique(groups):
        inside = np.flatnonzero(groups == group)
        if inside.size < 2:
            continue
        found.append(
            SharedOscillation(
                members=tuple(int(place) for place in loops[inside]),
                period=float(np.median(periods[loops[inside]])),
                similarity=float(np.min(alike.value[np.ix_(inside, inside)])),
            )
        )
    return tuple(sorted(found, key=lambda one: -len(one.members)))


def felt(reference: Real, others: Real, period: float) -> Real:
    """Measure how well other signals keep step with a loop that oscillates.

    A loop in which noise hides the oscillation, or that follows a moving set point, has no
    oscillation of its own that could be found; that it feels the group's shows in its coherence.

    Parameters
    ----------
    reference : ndarray, shape (n,)
        Error of the loop that shows the oscillation best.
    others : ndarray, shape (k, n)
        Errors or process variables of other loops at the same instants.
    period : float
        Period of the oscillation. [samples]

    Returns
    -------
    ndarray, shape (k,)
        Coherence; 0 where it is too low to mean anything, or the record too short.
    """
    locked = phase_locking(np.vstack([reference[None], others]), period)
    if locked is None:
        return np.zeros(len(others))
    coherence = locked.coherence[0, 1:]
    return np.where(coherence >= max(FELT, locked.limit(FELT_BY_CHANCE)), coherence, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Alike:
    """How alike pairs are, and how alike they have to be, both shape (m, m)."""

    value: Real
    limit: Real


def _alike(errors: Real, periods: Real) -> _Alike:
    m, n = errors.shape
    value, limit = np.eye(m), np.full((m, m), IN_STEP)
    spectra = _spectra(errors)
    for i in range(m):
        for j in range(i):
            period = float(periods[i] + periods[j]) / 2
            apart = abs(float(periods[i] - periods[j])) / period
            locked = [phase_locking(errors[[i, j]], float(periods[k])) for k in (i, j)]
            known = [one for one in locked if one is not None]
            if apart > SAME_PERIOD:
                alike, least = 0.0, IN_STEP
            elif len(known) == 2:
                alike = min(float(one.coherence[0, 1]) for one in known)
                least = max(IN_STEP, *(one.limit(CHANCE) for one in known))
            else:
                # One bin of the spectrum, as a part of the period, is the best that can be told.
                near = apart <= max(SAME_PERIOD_SHORT, period / n)
                alike = _cosine(spectra[i], spectra[j], period, n) if near else 0.0
                least = SIMILAR
            value[i, j] = value[j, i] = alike
            limit[i, j] = limit[j, i] = least
    return _Alike(value=value, limit=limit)


def _distances(alike: _Alike) -> Real:
    """How far pairs are from alike, 1 at the limit."""
    distances = (1.0 - alike.value) / (1.0 - alike.limit)
    np.fill_diagonal(distances, 0.0)
    return np.asarray(distances)


def _spectra(errors: Real) -> Real:
    """Amplitude spectra of errors that were freed of their trend and scaled."""
    free = detrend(errors, axis=1)
    spread = np.std(free, axis=1, keepdims=True)
    window = np.hanning(errors.shape[1])
    # What the straight line leaves of an error that does not move is rounding, not a signal.
    moves = spread > 1e-12 * np.max(np.abs(errors), axis=1, keepdims=True)
    scaled = np.divide(free, spread, out=np.zeros_like(free), where=moves)
    return np.abs(np.fft.rfft(scaled * window, axis=1))


def _cosine(a: Real, b: Real, period: float, n: int) -> float:
    """Cosine between two spectra in the octave around a period."""
    low, high = int(n / period / BAND), int(np.ceil(n / period * BAND)) + 1
    a, b = a[low:high], b[low:high]
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return min(float(a @ b) / size, 1.0) if size > 0 else 0.0
