"""How long the error stays on one side, against the window and the controller's integral time.

An integral action that reaches the process brings an error back within a few integral times;
where it does not, the error stays while OP goes on.
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft

from loop.signals import Real

# The error is smoothed over this part of the window, or of the integral time where that is less,
# and is seen beyond so many standard deviations of what noise leaves.
WINDOW_PART, RESET_PART, SEEN = 60, 4, 2.5
# An excursion is long beyond so many integral times: a well-behaved loop is back within two.
LONG = 3.0
# Shorter excursions have no second and third quarter. [samples]
FEWEST = 8
MOST_LEFT = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorExcursions:
    """Excursions of the smoothed error beyond noise, weighed by their energy where said.

    Attributes
    ----------
    count : int
        How many there are.
    longest : float
        Longest one over the window. [-]
    long_share : float
        Part of the energy in those that last for more than three integral times. [-]
    left : float
        Error in the third quarter over that in the second, energy-weighed, at most 3. [-]
    first_crossing : float
        Lag of the first zero of the autocorrelation over the window. [-]
    """

    count: int
    longest: float
    long_share: float
    left: float
    first_crossing: float


def error_excursions(error: Real, noise: float, Ti: float) -> ErrorExcursions:
    """Measure the excursions of an error.

    Parameters
    ----------
    error : ndarray, shape (n,)
        Error without gaps. [PV]
    noise : float
        Standard deviation of its white noise. [PV]
    Ti : float
        Integral time. [samples]
    """
    n = error.size
    width = max(int(min(n // WINDOW_PART, Ti / RESET_PART)), 1)
    slow = np.convolve(error, np.full(width, 1 / width), "same")
    side = np.where(np.abs(slow) > SEEN * noise / np.sqrt(width), np.sign(slow), 0.0)
    places = np.flatnonzero(side)
    crossing = _first_crossing(error)
    if not places.size:
        return ErrorExcursions(
            count=0, longest=0.0, long_share=0.0, left=0.0, first_crossing=crossing
        )
    ends = np.flatnonzero(np.diff(side[places]))
    firsts = places[np.concatenate([[0], ends + 1])]
    lasts = places[np.concatenate([ends, [places.size - 1]])] + 1
    lengths = lasts - firsts
    sums = np.concatenate([[0.0], np.cumsum(slow**2)])
    energy = sums[lasts] - sums[firsts]
    share = energy / energy.sum()
    return ErrorExcursions(
        count=lengths.size,
        longest=float(lengths.max()) / n,
        long_share=float(share[lengths > LONG * Ti].sum()),
        left=float(share @ _left(slow, firsts, lengths)),
        first_crossing=crossing,
    )


def _left(slow: Real, firsts: np.ndarray, lengths: np.ndarray) -> Real:
    """Mean size in the third quarter over that in the second; 0 for short excursions."""
    piled = np.concatenate([[0.0], np.cumsum(np.abs(slow))])
    quarter = lengths // 4
    early = piled[firsts + 2 * quarter] - piled[firsts + quarter]
    ends = firsts + lengths
    late = piled[ends - quarter] - piled[ends - 2 * quarter]
    ratio = np.divide(late, early, out=np.zeros(early.size), where=early > 0)
    return np.asarray(np.where(lengths >= FEWEST, np.minimum(ratio, MOST_LEFT), 0.0))


def _first_crossing(error: Real) -> float:
    n = error.size
    centred = error - error.mean()
    size = scipy.fft.next_fast_len(2 * n, real=True)
    power = np.abs(scipy.fft.rfft(centred, size)) ** 2
    r = scipy.fft.irfft(power, size)[: n // 2]
    below = np.flatnonzero(r < 0)
    return float(below[0] if below.size else n // 2) / n
