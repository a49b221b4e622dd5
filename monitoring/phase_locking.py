"""Do two signals keep step at one period? Coherence over stretches of a few cycles."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from loop.signals import Flags, Real

# Cycles in a stretch: its spectral line is then as wide as an octave, so that a period that wanders
# stays within.
CYCLES = 4
FEWEST_STRETCHES = 5
# Hann windows that overlap by half share a third of their weight; K of them are worth so many
# independent ones (from the correlation 1/6 of neighbouring windows: 1/(1 + 2/36)).
WORTH = 0.947


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhaseLocking:
    """How far signals keep step, pair by pair.

    Attributes
    ----------
    coherence : ndarray, shape (m, m)
        Part of one signal's power at the period that follows the other; 1 on the diagonal. [-]
    phase : ndarray, shape (m, m)
        Phase of the second signal (column) against the first (row). [rad]
    stretches : float
        Independent stretches that this rests on. [-]
    """

    coherence: Real
    phase: Real
    stretches: float

    def limit(self, chance: float) -> float:
        """Coherence that two independent signals exceed with this chance, by 1 - chance^(1/(K-1)).

        Parameters
        ----------
        chance : float
            Chance, 0 to 1. [-]
        """
        return float(1.0 - chance ** (1.0 / (self.stretches - 1.0)))


def phase_locking(signals: Real, period: float, *, harmonic: int = 1) -> PhaseLocking | None:
    """Measure the coherence of every pair at one period, or at a harmonic of it.

    C_ab = |sum_k A_k B_k*|^2 / (sum_k |A_k|^2 sum_k |B_k|^2), A_k and B_k the Fourier coefficients
    at the period of stretch k, four cycles long, under a Hann window, each freed of its line.

    Parameters
    ----------
    signals : ndarray, shape (m, n)
        Signals at the same instants, without gaps.
    period : float
        Period. [samples]
    harmonic : int
        1 for the period itself, k for period/k.

    Returns
    -------
    PhaseLocking or None
        None where the record holds fewer than five stretches.
    """
    length = round(CYCLES * period)
    if length < 4 * CYCLES or signals.shape[1] < length * (FEWEST_STRETCHES + 1) // 2:
        return None
    starts = np.arange(0, signals.shape[1] - length + 1, max(length // 2, 1))
    wave = np.hanning(length) * np.exp(-2j * np.pi * harmonic * np.arange(length) / period)
    stretches = np.lib.stride_tricks.sliding_window_view(signals, length, axis=1)[:, starts]
    lines = detrend(stretches, axis=2) @ wave
    lines[~moving(signals)] = 0.0
    power = np.sum(np.abs(lines) ** 2, axis=1)
    products = lines.conj() @ lines.T
    cross = np.abs(products) ** 2
    size = np.outer(power, power)
    coherence = np.divide(cross, size, out=np.zeros_like(cross), where=size > 0)
    np.fill_diagonal(coherence, 1.0)
    return PhaseLocking(
        coherence=np.minimum(coherence, 1.0),
        phase=np.angle(products),
        stretches=float(max(WORTH * starts.size, 2.0)),
    )


def moving(signals: Real) -> Flags:
    """Tell which rows move by more than rounding.

    Parameters
    ----------
    signals : ndarray, shape (m, n)
        Signals without gaps.
    """
    return np.asarray(np.ptp(signals, axis=1) > 1e-12 * np.max(np.abs(signals), axis=1))
