"""How long a shared oscillation takes from one loop to another, and how far that can be known."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.signal import detrend

from loop.signals import Real
from monitoring.phase_locking import moving, phase_locking

# The wave and two harmonics; below half its frequency lies drift.
LOWEST, HIGHEST = 0.5, 3.5
HARMONICS = 3
# Stretches in which the correlation is measured on its own, and cycles in each.
STRETCHES = 8
FEWEST_STRETCHES = 4
FEWEST_CYCLES = 4
# Student's t by which the peak must stand above the one half a period or a period away.
CLEAR = 3.0
# A harmonic counts where two independent signals would seldom keep step so well.
CHANCE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagation:
    """By how much one signal follows another.

    Attributes
    ----------
    first, second : int
        Places of the signals, in the order given.
    delay : float
        The second follows the first by so much; negative where it leads. [samples]
    error : float
        Its standard error, from stretches of the record. [samples]
    sign : {1, -1}
        Whether the second follows the first or its mirror image.
    correlation : float
        Correlation at that delay, without sign. [-]
    rival : float
        The next best delay: about half a period away with the other sign, or a period. [samples]
    clear : bool
        The correlation stands above that of every rival by three standard errors. Where it does
        not, the delay is known up to the rivals only.
    phase_delay : float or None
        Delay from the phases at the period and its harmonics, up to whole periods, between plus
        and minus half of one; None where no harmonic is common to both. [samples]
    """

    first: int
    second: int
    delay: float
    error: float
    sign: int
    correlation: float
    rival: float
    clear: bool
    phase_delay: float | None


def propagation(signals: Real, period: float) -> tuple[Propagation, ...]:
    """Measure the delay between every pair of signals that share an oscillation.

    The signals are filtered to the wave and two harmonics, and correlated over plus and minus one
    period. A wave that never changes has the same correlation a period later; what tells delays
    apart is that real ones wander in size and phase. The phases phi_k at the harmonics k that both
    share give the delay d a second time, up to whole periods: phi_k = -2 pi k d/period, plus pi
    where the sign is turned.

    Parameters
    ----------
    signals : ndarray, shape (m, n)
        Signals at the same instants, without gaps.
    period : float
        Their period. [samples]

    Returns
    -------
    tuple of Propagation
        Pairs first < second; none where the record is shorter than 16 cycles.

    Raises
    ------
    ValueError
        The signals are not rows of finite numbers, or the period is shorter than 4 samples.
    """
    signals = np.asarray(signals, dtype=np.float64)
    if signals.ndim != 2 or not np.all(np.isfinite(signals)):
        raise ValueError("signals must be rows of finite numbers, gaps bridged or left out")
    if not period >= 4:
        raise ValueError(f"period must be at least 4 samples, got {period}")
    n = signals.shape[1]
    count = min(STRETCHES, int(n / (FEWEST_CYCLES * period)))
    if count < FEWEST_STRETCHES:
        return ()
    waves = _band(signals, period)
    reach = int(np.ceil(period))
    moves = np.flatnonzero(moving(signals)).tolist()
    found = []
    for i, j in combinations(moves, 2):
        parts = _correlations(waves[i], waves[j], reach, count)
        found.append(_measured(parts, signals[[i, j]], (i, j), period))
    return tuple(found)


def _band(signals: Real, period: float) -> Real:
    """Keep the wave and its harmonics."""
    n = signals.shape[1]
    spectra = np.fft.rfft(detrend(signals, axis=1) * _taper(n, period), axis=1)
    order = np.arange(spectra.shape[1]) * period / n
    spectra[:, (order < LOWEST) | (order > HIGHEST)] = 0.0
    return np.fft.irfft(spectra, n, axis=1)


def _taper(n: int, period: float) -> Real:
    """Fade the first and last period, so that the ends make no step."""
    edge = min(int(period), n // 8)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    window = np.ones(n)
    window[:edge], window[n - edge :] = ramp, ramp[::-1]
    return window


def _correlations(a: Real, b: Real, reach: int, count: int) -> Real:
    """Correlation of stretches of a with b at lags -reach..reach, shape (count, 2 reach + 1)."""
    size = float(np.sqrt((a @ a) * (b @ b)))
    edges = np.linspace(reach, a.size - reach, count + 1).astype(np.int64)
    length = int(np.min(np.diff(edges)))
    parts = np.empty((count, 2 * reach + 1))
    for k, start in enumerate(edges[:-1]):
        windows = np.lib.stride_tricks.sliding_window_view(
            b[start - reach : start + length + reach], length
        )
        parts[k] = windows @ a[start : start + length]
    return parts * count / size


def _measured(parts: Real, pair: Real, places: tuple[int, int], period: float) -> Propagation:
    reach = (parts.shape[1] - 1) // 2
    mean = np.mean(parts, axis=0)
    best = int(np.argmax(np.abs(mean)))
    sign = 1 if mean[best] > 0 else -1
    inner = np.abs(mean[1:-1])
    peaks = 1 + np.flatnonzero((inner >= np.abs(mean[:-2])) & (inner > np.abs(mean[2:])))
    rivals = [int(k) for k in peaks if abs(k - best) > period / 4]
    # The ends of the lags are rivals too: the peak may go on rising beyond them.
    rivals += [end for end in (0, 2 * reach) if abs(end - best) > period / 4]
    clear = 0 < best < 2 * reach
    for rival in rivals:
        ahead = sign * parts[:, best] - np.sign(mean[rival]) * parts[:, rival]
        spread = float(np.std(ahead, ddof=1)) / np.sqrt(ahead.size)
        clear &= float(np.mean(ahead)) > CLEAR * spread
    rival = max(rivals, key=lambda k: abs(float(mean[k])), default=best)
    # Leaving out one stretch at a time (jackknife).
    count = parts.shape[0]
    rest = (count * mean - parts) / (count - 1)
    window = slice(max(best - int(period / 4), 0), best + int(period / 4) + 1)
    delays = np.array([_top(sign * row[window]) for row in rest])
    error = float(np.sqrt((count - 1) / count * np.sum((delays - np.mean(delays)) ** 2)))
    return Propagation(
        first=places[0],
        second=places[1],
        delay=_top(sign * mean[window]) + window.start - reach,
        error=error,
        sign=sign,
        correlation=min(abs(float(mean[best])), 1.0),
        rival=float(rival - reach),
        clear=bool(clear),
        phase_delay=_phases(pair, period, sign),
    )


def _top(row: Real) -> float:
    """Place of the highest value, by the parabola through it and its neighbours."""
    k = int(np.argmax(row))
    if not 0 < k < row.size - 1:
        return float(k)
    before, here, after = row[k - 1 : k + 2]
    bend = before - 2 * here + after
    return k + (0.5 * float((before - after) / bend) if bend < 0 else 0.0)


def _phases(pair: Real, period: float, sign: int) -> float | None:
    """Delay from the phases at the harmonics both share, up to whole periods."""
    orders, angles = [], []
    for k in range(1, HARMONICS + 1):
        if period / k < 4:
            break
        locked = phase_locking(pair, period, harmonic=k)
        if locked is None or locked.coherence[0, 1] < locked.limit(CHANCE):
            continue
        orders.append(k)
        angles.append(float(locked.phase[0, 1]))
    if len(orders) < 2 or orders[0] != 1:
        return None
    delays = np.linspace(-0.5, 0.5, 201) * period
    turns = 2 * np.pi * np.array(orders) * delays[:, None] / period
    turned = 0.0 if sign > 0 else np.pi
    misfit = np.sum(1 - np.cos(np.array(angles) + turns - turned), axis=1)
    return float(delays[int(np.argmin(misfit))])
