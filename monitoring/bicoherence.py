"""Bicoherence: is the error non-Gaussian, and if so, non-linear?"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.fft

from loop.signals import Real

SEGMENT, NFFT = 64, 128
# Lowest frequency of a pair; the mean is left out. [bins]
LOWEST = 2
MOST_SAMPLES = 4096
FEWEST_SEGMENTS = 16
# One-sided 95 % point of the normal distribution.
C_ALPHA = 1.645
NGI_LIMIT, NLI_LIMIT = 0.001, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Bicoherence:
    """Non-Gaussianity and, only where that fires, non-linearity [1]_.

    Attributes
    ----------
    NGI : float
        mean(bic^2) - (c + sqrt(4L - 1))^2/(4KL), K segments, L bifrequencies. [-]
    NLI : float or None
        |max(bic^2) - (mean + 2 sd)|; None unless NGI fires, because it means nothing then. [-]
    segments : int
        K, overlapping by half.

    Notes
    -----
    Blind to waves whose second half is the first with the sign changed: they have no second
    harmonic, and a symmetric stiction cycle is such a wave.

    References
    ----------
    .. [1] M. A. A. S. Choudhury, S. L. Shah and N. F. Thornhill, "Diagnosis of poor control-loop
       performance using higher-order statistics", Automatica 40 (2004); from memory.
    """

    NGI: float
    NLI: float | None
    segments: int

    @property
    def nonlinear(self) -> bool:
        """Both indices beyond their limits."""
        return self.NGI > NGI_LIMIT and self.NLI is not None and self.NLI > NLI_LIMIT


def bicoherence(error: Real) -> Bicoherence | None:
    r"""Estimate the squared bicoherence from overlapping segments.

    .. math:: bic^2 = \frac{|E[X(f_1)X(f_2)X^*(f_1+f_2)]|^2}
              {E[|X(f_1)X(f_2)|^2]\,E[|X(f_1+f_2)|^2]}

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error without gaps, about 8 to 32 samples a cycle; the last 4096 are used. [PV]

    Returns
    -------
    Bicoherence or None
        None for fewer than 16 segments or an error that does not move. Products of three
        transforms are taken in single precision: bic^2 is exact to about a millionth.
    """
    x = error[-MOST_SAMPLES:]
    segments = 2 * (x.size // SEGMENT) - 1
    if segments < FEWEST_SEGMENTS:
        return None
    rows = np.lib.stride_tricks.sliding_window_view(x, SEGMENT)[:: SEGMENT // 2][:segments]
    rows = rows - rows.mean(axis=1, keepdims=True)
    scale = float(np.std(rows)) or 1.0
    X = scipy.fft.rfft(rows * (_window() / scale), NFFT, axis=1)
    power = (X.real**2 + X.imag**2).T
    # One line a frequency, so that picking frequencies copies whole lines. Single precision is
    # exact to a millionth of bic^2 and halves the memory of all pairs, which is what takes time.
    lines = np.ascontiguousarray(X.T, dtype=np.complex64)
    first, second = _principal_domain()
    pairs = lines[first]
    pairs *= lines[second]
    sums = np.vecdot(lines[first + second], pairs)
    numerator = (sums.real**2 + sums.imag**2).astype(np.float64)
    denominator = (power @ power.T)[first, second] * np.sum(power, axis=1)[first + second]
    if not float(np.max(denominator)) > 0:
        return None
    # Bifrequencies without power hold rounding alone; the floor keeps their ratio near zero.
    bic2 = numerator / (denominator + 1e-3 * float(np.mean(denominator)))
    size, count = bic2.size, rows.shape[0]
    mean = float(np.mean(bic2))
    limit = (C_ALPHA + np.sqrt(4 * size - 1)) ** 2 / (4 * count * size)
    NGI = float(mean - limit)
    return Bicoherence(
        NGI=NGI,
        NLI=float(abs(np.max(bic2) - (mean + 2 * np.std(bic2)))) if NGI > NGI_LIMIT else None,
        segments=count,
    )


@cache
def _window() -> Real:
    return np.asarray(np.hanning(SEGMENT))


@cache
def _principal_domain() -> tuple[np.ndarray, np.ndarray]:
    """Pairs f2 <= f1, f1 + f2 <= half the sampling frequency; the mean is left out."""
    first, second = np.meshgrid(np.arange(NFFT // 2 + 1), np.arange(NFFT // 2 + 1), indexing="ij")
    inside = (second >= LOWEST) & (second <= first) & (first + second <= NFFT // 2)
    return first[inside], second[inside]
