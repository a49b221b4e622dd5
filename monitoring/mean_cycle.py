"""The mean cycle of an oscillating loop: noise averages out, the wave's shape stays."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.spectrum import band_pass

POINTS = 64
FEWEST_CYCLES = 3
BAND = 2**0.4
# Cycles longer or shorter than the median by more than this part are left out.
ODD_LENGTH = 0.35


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeanCycle:
    """Mean waves of OP and PV over one cycle of OP, from its upward crossing.

    Attributes
    ----------
    op, pv : ndarray, shape (64,)
        Mean waves about their means. [OP], [PV]
    op_likeness, pv_likeness : float
        Variance of the mean wave over that of all cycles: 1 for a pure repetition. [-]
    cycles : int
        Cycles averaged.
    """

    op: Real
    pv: Real
    op_likeness: float
    pv_likeness: float
    cycles: int


def mean_cycle(op: Real, pv: Real, period: float) -> MeanCycle | None:
    """Average the cycles of OP and PV, drift taken off by a moving mean over one period.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
        Output and process variable without gaps. [OP], [PV]
    period : float
        Period. [samples]

    Returns
    -------
    MeanCycle or None
        None where OP does not move or fewer than three cycles are alike in length.
    """
    wave = band_pass(op, period, width=BAND)
    up = np.flatnonzero((wave[1:] > 0) & (wave[:-1] <= 0))
    if up.size <= FEWEST_CYCLES:
        return None
    crossings = up + wave[up] / (wave[up] - wave[up + 1])
    lengths = np.diff(crossings)
    alike = np.abs(lengths / np.median(lengths) - 1) <= ODD_LENGTH
    if np.count_nonzero(alike) < FEWEST_CYCLES:
        return None
    grid = crossings[:-1][alike, None] + lengths[alike, None] * (np.arange(POINTS) / POINTS)
    window = max(round(float(np.median(lengths))), 2)
    op_wave, op_likeness = _averaged(op, grid, window)
    pv_wave, pv_likeness = _averaged(pv, grid, window)
    if _within_rounding(op_wave, op) or _within_rounding(pv_wave, pv):
        return None
    return MeanCycle(
        op=op_wave,
        pv=pv_wave,
        op_likeness=op_likeness,
        pv_likeness=pv_likeness,
        cycles=int(np.count_nonzero(alike)),
    )


def _within_rounding(wave: Real, signal: Real) -> bool:
    """A wave so small that its powers are those of rounding alone."""
    return bool(np.ptp(wave) <= 1e-12 * np.max(np.abs(signal)) + 1e-100)


def _averaged(signal: Real, grid: Real, window: int) -> tuple[Real, float]:
    """Mean wave and its likeness to the cycles."""
    padded = np.pad(signal, (window // 2, window - window // 2), mode="reflect")
    sums = np.cumsum(np.r_[0.0, padded])
    still = signal - (sums[window:] - sums[:-window])[: signal.size] / window
    cycles = np.interp(grid, np.arange(signal.size), still)
    cycles -= cycles.mean(axis=1, keepdims=True)
    mean = cycles.mean(axis=0)
    variance = float(np.var(cycles))
    return mean, float(np.var(mean) / variance) if variance > 0 else 0.0
