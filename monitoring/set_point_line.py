"""Does the set point itself swing with the period of the error, and by enough to drive it?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from loop.signals import Real
from monitoring.basis import Basis, graded
from monitoring.oscillation import OscillationComponent

# Power of the line over the mean of its neighbours; chance reaches it once in a hundred times.
CLEAR = 7.0
# The error of a loop with a sensitivity of up to 2 is at most twice as large as what drives it.
LEAST_RATIO = 0.5
# Neighbours of a line [cycles in its time]: outside the lobe of the window, short of a harmonic.
NEIGHBOURS = (3.0, 3.5, 4.0, 4.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPointLine:
    """The set point at the frequency of the error's main oscillation.

    Attributes
    ----------
    ratio : float
        Amplitude of the set point there over that of the error. [-]
    score : float
        Power there over the mean of the frequencies beside it: a set point that moves now and
        then has power everywhere, one that swings has a line. [-]
    drives : bool
        The line is clear, and large enough to make the error swing as it does.
    basis : Basis
        What this rests on.
    """

    ratio: float
    score: float
    drives: bool
    basis: Basis


def set_point_line(
    sp: Real, dt: float, wave: OscillationComponent, *, share: float = 1.0
) -> SetPointLine:
    """Look for the period of an oscillation of the error in the set point, while it lasts.

    Parameters
    ----------
    sp : ndarray, shape (n,)
        Set point, evenly sampled, without gaps, of the same samples as the error. [PV]
    dt : float
        Sample time. [s]
    wave : OscillationComponent
        Oscillation of the error.
    share : float
        Part of the record that the set point covers. [-]
    """
    part = sp[max(int(wave.start / dt), 0) : int(np.ceil(wave.end / dt)) + 1]
    window = np.hanning(part.size + 2)[1:-1]
    cycles = part.size * dt / wave.period
    apart = np.array([0.0, *NEIGHBOURS, *(-step for step in NEIGHBOURS)])
    lines = cycles + apart[cycles + apart > 0]
    whole = float(np.sum(window))
    # From its first value, so that a set point at rest is nothing and not rounding.
    moved = part - part[0]
    still = (moved - float(moved @ window) / whole) * window
    amplitudes = 2 * np.abs(line_sums(still, lines)) / whole
    beside = float(np.mean(amplitudes[1:] ** 2))
    score = float(amplitudes[0] ** 2 / beside) if beside > 0 else 0.0
    ratio = float(amplitudes[0] / wave.amplitude) if wave.amplitude > 0 else 0.0
    return SetPointLine(
        ratio=ratio,
        score=score,
        drives=score >= CLEAR and ratio >= LEAST_RATIO,
        basis=graded(share, settings=(("clear line, power", CLEAR), ("least ratio", LEAST_RATIO))),
    )


def line_sums(signal: Real, cycles: Real) -> NDArray[np.complex128]:
    """Sum of signal[k] exp(-2 pi i c k/n) at a few frequencies c, not only whole ones.

    The signal is laid out in rows as long as there are rows: each row is turned and summed by one
    matrix product, then the rows by where they begin. That takes 2 sqrt(n) turns a frequency
    instead of n.

    Parameters
    ----------
    signal : ndarray, shape (n,)
    cycles : ndarray, shape (m,)
        Frequencies. [cycles in n samples]

    Returns
    -------
    ndarray of complex, shape (m,)
    """
    width = int(np.ceil(np.sqrt(signal.size)))
    rows = np.zeros(width * width)
    rows[: signal.size] = signal
    step = -2j * np.pi * cycles / signal.size
    within = np.exp(np.arange(width)[:, None] * step)
    # Real times complex would be taken as complex times complex.
    sums = (rows.reshape(width, width) @ within.view(np.float64)).view(np.complex128)
    return np.asarray(np.sum(sums * np.exp(np.arange(0, rows.size, width)[:, None] * step), axis=0))
