"""Is a signal's own past non-linear? The loop nearest to a sticking valve shows it most."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real

# Samples a cycle after thinning, cycles that are looked at, neighbours, surrogates: settings.
A_CYCLE = 12
MOST_CYCLES = 24
FEWEST_CYCLES = 10
NEIGHBOURS = 8
SURROGATES = 60
# Three standard deviations of the surrogates; the method's page says how often that misleads.
LIMIT = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Nonlinearity:
    """How much better a signal predicts itself than its linear look-alikes do.

    Attributes
    ----------
    index : float or None
        (mean error of the surrogates less the signal's own) / (3 standard deviations of the
        surrogates' errors); above 1 the signal is not linear. None where it is too short. [-]
    reason : str
        Why there is no index; empty otherwise.
    """

    index: float | None
    reason: str = ""

    @property
    def significant(self) -> bool:
        """Whether the signal is not that of a linear loop."""
        return self.index is not None and self.index > LIMIT


def nonlinearity(error: Real, period: float, *, seed: int = 0) -> Nonlinearity:
    """Compare how well a signal predicts itself with its phase-randomised surrogates [1]_.

    A stretch of one cycle is matched with its nearest neighbours elsewhere in the signal, and what
    followed them predicts what follows it, half a cycle on. A limit cycle repeats its shape, and
    its harmonics keep their phase; a surrogate has the same spectrum and lost phases. Ends that do
    not meet would themselves look like a feature: the signal is cut to whole cycles first.

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error, evenly sampled, without gaps.
    period : float
        Period of its oscillation. [samples]
    seed : int
        Seed of the surrogates.

    References
    ----------
    .. [1] N. F. Thornhill, "Finding the source of nonlinearity in a process with plant-wide
       oscillation" (2005), definition from memory.
    """
    if not (np.isfinite(period) and period >= 4):
        return Nonlinearity(index=None, reason="the period is shorter than 4 samples")
    signal = _thinned(error, period)
    a_cycle = min(A_CYCLE, max(4, round(period)))
    cycles = signal.size // a_cycle
    if cycles < FEWEST_CYCLES:
        why = f"{cycles} cycles are fewer than {FEWEST_CYCLES}"
        return Nonlinearity(index=None, reason=why)
    signal = _ends_meeting(signal[-min(cycles, MOST_CYCLES) * a_cycle :], a_cycle)
    if not np.ptp(signal) > 0:
        return Nonlinearity(index=None, reason="the error does not move")
    signal = (signal - np.mean(signal)) / np.std(signal)
    rng = np.random.default_rng(seed)
    own = _prediction_error(signal, a_cycle)
    others = np.array(
        [_prediction_error(_surrogate(signal, rng), a_cycle) for _ in range(SURROGATES)]
    )
    spread = float(np.std(others, ddof=1))
    if not spread > 0:
        return Nonlinearity(index=None, reason="the surrogates do not differ")
    return Nonlinearity(index=float((np.mean(others) - own) / (3 * spread)))


def _thinned(error: Real, period: float) -> Real:
    """Average to about a dozen samples a cycle, so that slow and fast loops are judged alike."""
    step = max(int(period // A_CYCLE), 1)
    if step == 1:
        return error
    return np.asarray(np.mean(error[: error.size // step * step].reshape(-1, step), axis=1))


def _ends_meeting(signal: Real, a_cycle: int) -> Real:
    """Cut within the first and last cycle where the ends differ least."""
    window = min(a_cycle, signal.size // 4)
    starts, ends = signal[:window], signal[-window:]
    gaps = np.abs(starts[:, None] - ends[None, :])
    slopes = np.abs(np.gradient(signal)[:window, None] - np.gradient(signal)[None, -window:])
    first, last = np.unravel_index(int(np.argmin(gaps + slopes)), gaps.shape)
    return signal[int(first) : signal.size - window + int(last)]


def _prediction_error(signal: Real, a_cycle: int) -> float:
    """Root mean square error of predicting half a cycle on from the nearest stretches."""
    ahead = max(a_cycle // 2, 1)
    stretches = np.lib.stride_tricks.sliding_window_view(signal[: signal.size - ahead], a_cycle)
    following = signal[a_cycle - 1 + ahead :]
    squares = np.sum(stretches**2, axis=1)
    distances = squares[:, None] + squares[None, :] - 2 * stretches @ stretches.T
    places = np.arange(squares.size)
    # A stretch is like the one that begins a moment later because it is the same one.
    distances[np.abs(places[:, None] - places[None, :]) < a_cycle // 2] = np.inf
    nearest = np.argpartition(distances, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
    predicted = np.mean(following[nearest], axis=1)
    return float(np.sqrt(np.mean((following - predicted) ** 2)))


def _surrogate(signal: Real, rng: np.random.Generator) -> Real:
    """Give the signal's spectrum other phases."""
    spectrum = np.fft.rfft(signal)
    phases = rng.uniform(0, 2 * np.pi, spectrum.size)
    phases[0] = 0.0
    if signal.size % 2 == 0:
        phases[-1] = 0.0
    return np.fft.irfft(np.abs(spectrum) * np.exp(1j * phases), signal.size)
