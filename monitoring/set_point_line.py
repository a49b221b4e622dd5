"""Does the set point itself swing with the period of the error, and by enough to drive it?"""

from dataclasses import dataclass

import numpy as np

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
    turns = np.exp(-2j * np.pi * np.outer(lines, np.arange(part.size) / part.size))
    still = (part - np.average(part, weights=window)) * window
    amplitudes = 2 * np.abs(turns @ still) / float(np.sum(window))
    beside = float(np.mean(amplitudes[1:] ** 2))
    score = float(amplitudes[0] ** 2 / beside) if beside > 0 else 0.0
    ratio = float(amplitudes[0] / wave.amplitude) if wave.amplitude > 0 else 0.0
    return SetPointLine(
        ratio=ratio,
        score=score,
        drives=score >= CLEAR and ratio >= LEAST_RATIO,
        basis=graded(share, settings=(("clear line, power", CLEAR), ("least ratio", LEAST_RATIO))),
    )
