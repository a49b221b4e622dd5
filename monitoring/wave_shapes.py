"""Which shape a wave has: sine, triangle, relay response or square.

Every shape is odd: its second half is the first with the sign changed. It is laid at every phase
of the wave, and what is left of the wave's power is its misfit.
"""

from functools import cache

import numpy as np

from loop.signals import Real
from monitoring.mean_cycle import POINTS

# Places of the peak of a triangle in its half wave; the corners are sawteeth.
PEAKS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
# Time constants of a relay response over its half period.
LAGS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)


def sine_misfit(wave: Real) -> float:
    """Part of a wave's power outside its fundamental. [-]"""
    spectrum = np.abs(np.fft.rfft(wave)) ** 2
    power = float(np.sum(spectrum[1:]))
    return float(1 - spectrum[1] / power) if power > 0 else 1.0


def triangle_misfit(wave: Real) -> float:
    """Part of a wave's power that the best triangle or sawtooth leaves. [-]"""
    return _misfit(wave, _triangles())


def relay_misfit(wave: Real) -> float:
    """Part of a wave's power that the best first-order response to a square wave leaves. [-]"""
    return _misfit(wave, _relay_responses())


def likeness_index(sine: float, other: float) -> float:
    """(E_sine - E_other)/(E_sine + E_other): 1 for the other shape, -1 for a sine. [-]"""
    total = sine + other
    return (sine - other) / total if total > 0 else 0.0


def he_index(wave: Real) -> float:
    """Curve-fitting index E_sine/(E_sine + E_triangle) [1]_, on the mean cycle. [-]

    Up to 0.4 no stiction, from 0.6 stiction. The original fits every half cycle; the mean cycle
    has less noise.

    References
    ----------
    .. [1] Q. P. He et al., Industrial & Engineering Chemistry Research 46 (2007); from memory.
    """
    sine, triangle = sine_misfit(wave), triangle_misfit(wave)
    total = sine + triangle
    return sine / total if total > 0 else 0.5


def rossi_scali_index(wave: Real) -> float:
    """Relay-fitting index (E_sine - E_RT)/(E_sine + E_RT), E_RT = min(relay, triangle) [1]_. [-]

    Within 0.21 of 0 it is undecided.

    References
    ----------
    .. [1] M. Rossi and C. Scali, Journal of Process Control 15 (2005); from memory.
    """
    return likeness_index(sine_misfit(wave), min(relay_misfit(wave), triangle_misfit(wave)))


def hagglund_index(wave: Real) -> float:
    """Square-fitting index (V_sine - V_square)/(V_sine + V_square) [1]_, above 0 for stiction. [-]

    The amplitudes come from the area: a_sine = pi IAE/Tp for a half wave, a_square = 2 IAE/Tp.

    References
    ----------
    .. [1] T. Hägglund, "A shape-analysis approach for diagnosis of stiction in control valves",
       Control Engineering Practice 19 (2011); as in a public program.
    """
    mean_size = float(np.mean(np.abs(wave)))
    if not mean_size > 0:
        return 0.0
    phase = np.angle(np.fft.rfft(wave)[1])
    angle = 2 * np.pi * np.arange(wave.size) / wave.size + phase
    sine = np.pi / 2 * mean_size * np.cos(angle)
    square = mean_size * np.sign(np.cos(angle))
    return likeness_index(float(np.mean((wave - sine) ** 2)), float(np.mean((wave - square) ** 2)))


def area_ratio(wave: Real) -> float:
    """Area from zero to peak over area from peak to zero, mean of both half waves [1]_. [-]

    Above 1 for a wave that rises slowly and falls fast, as stiction makes the error of some loops.

    References
    ----------
    .. [1] A. Singhal and T. I. Salsbury, Journal of Process Control 15 (2005); from memory.
    """
    smooth = np.fft.irfft(np.fft.rfft(wave)[:8], wave.size)
    up = np.flatnonzero((smooth > 0) & (np.roll(smooth, 1) <= 0))
    if up.size == 0:
        return 1.0
    turned = np.roll(smooth, -int(up[0]))
    down = int(np.argmax(turned <= 0)) or turned.size
    halves = [half for half in (turned[:down], -turned[down:]) if half.size >= 3]
    before = sum(float(np.sum(half[: int(np.argmax(half)) + 1])) for half in halves)
    after = sum(float(np.sum(half[int(np.argmax(half)) :])) for half in halves)
    return float(np.clip(before / after, 0.1, 10.0)) if after > 0 and before > 0 else 1.0


def slope_kurtosis(wave: Real) -> float:
    """Kurtosis of the slope: 1 for a triangle, 1.5 for a sine, large for jumps. [-]"""
    slope = np.diff(np.r_[wave, wave[0]])
    steepest = float(np.max(np.abs(slope)))
    if not steepest > 0:
        return 1.5
    slope = slope / steepest  # so that no power of a tiny wave vanishes
    return float(np.mean(slope**4) / np.mean(slope**2) ** 2)


def harmonic(wave: Real, order: int) -> float:
    """Power of a harmonic over that of the fundamental. [-]"""
    spectrum = np.abs(np.fft.rfft(wave)) ** 2
    return float(spectrum[order] / spectrum[1]) if spectrum[1] > 0 else 0.0


def _misfit(wave: Real, shapes: Real) -> float:
    """Least part of the power that a shape at its best phase leaves."""
    spectrum = np.fft.rfft(wave - wave.mean())
    power = float(np.sum((wave - wave.mean()) ** 2))
    if not power > 0:
        return 1.0
    products = np.fft.irfft(spectrum * shapes, wave.size, axis=1)
    return float(max(1 - float(np.max(products**2)) / power, 0.0))


def _spectra(halves: Real) -> Real:
    """Conjugate spectra of odd waves of unit power, given by their first halves."""
    waves = np.hstack([halves, -halves])
    waves -= waves.mean(axis=1, keepdims=True)
    waves /= np.linalg.norm(waves, axis=1, keepdims=True)
    return np.asarray(np.conj(np.fft.rfft(waves, axis=1)))


@cache
def _triangles() -> Real:
    x = (np.arange(POINTS // 2)) / (POINTS // 2)
    return _spectra(
        np.stack([np.where(x < peak, x / peak, (1 - x) / (1 - peak)) for peak in PEAKS])
    )


@cache
def _relay_responses() -> Real:
    x = (np.arange(POINTS // 2)) / (POINTS // 2)
    return _spectra(np.stack([1 - 2 * np.exp(-x / lag) / (1 + np.exp(-1 / lag)) for lag in LAGS]))
