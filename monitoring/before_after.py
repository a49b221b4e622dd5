"""Did a change help? Two periods of a loop compared, autocorrelation respected."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import stdtrit

from loop.autoregression import autocovariance
from loop.signals import Real
from monitoring.basis import Basis, graded, refusal

FEWEST_BLOCKS = 10
DRAWS = 2000
# The autocorrelation is gone where it first falls below the one; an oscillation comes back, and has
# faded where it stays below the other, which chance hardly reaches.
GONE, FADED = 0.1, 0.4


class Change(StrEnum):
    """What two periods show."""

    BETTER = "better"
    WORSE = "worse"
    NO_DIFFERENCE = "no significant difference"
    NOT_COMPARABLE = "not comparable"


@dataclass(frozen=True, slots=True, kw_only=True)
class BeforeAfter:
    """Mean square of the error after over before.

    Attributes
    ----------
    change : Change
        What the interval says.
    ratio : float or None
        Root mean square of the error after over before. [-]
    low, high : float or None
        Its 95 % interval. [-]
    probability : float or None
        Share of the draws in which the error became smaller. [-]
    block : int
        Length of a block. [samples]
    basis : Basis
        What this rests on.
    """

    change: Change
    ratio: float | None
    low: float | None
    high: float | None
    probability: float | None
    block: int
    basis: Basis


def before_after(
    before: Real, after: Real, *, seed: int = 0, draws: int = DRAWS, block: int | None = None
) -> BeforeAfter:
    """Compare the errors of two periods by a circular block bootstrap [1]_.

    Blocks as long as the error remembers keep its autocorrelation; drawing single samples would
    take a thousand samples of one slow wave for a thousand facts.

    Parameters
    ----------
    before, after : ndarray, shape (n,), (m,)
        Control errors, evenly sampled with the same sample time, NaN in gaps. [PV]
    seed : int
        Seed of the draws.
    draws : int
        Number of draws.
    block : int, optional
        Length of a block; three times the memory of the longer-remembering error by default, and
        at least the cube root of the record. [samples]

    References
    ----------
    .. [1] D. N. Politis and J. P. Romano, "A circular block-resampling procedure for stationary
       data" (1992); from memory.
    """
    first, second = (signal[np.isfinite(signal)] for signal in (before, after))
    length = block or max(_memory(first), _memory(second))
    settings = (("block, samples", float(length)), ("draws", float(draws)), ("seed", float(seed)))
    blocks = min(first.size, second.size) // max(length, 1)
    if blocks < FEWEST_BLOCKS:
        why = (
            f"the shorter period holds {blocks} blocks of {length} samples, "
            f"fewer than {FEWEST_BLOCKS}"
        )
        return _not_comparable(why, length, settings)
    powers = [float(np.mean(signal**2)) for signal in (first, second)]
    if min(powers) <= 0:
        return _not_comparable("one of the errors does not move", length, settings)
    rng = np.random.default_rng(seed)
    drawn = [_drawn(signal**2, length, draws, rng) for signal in (first, second)]
    ratio = float(np.sqrt(powers[1] / powers[0]))
    # A spread that comes from few blocks is itself uncertain: Student's t instead of the normal.
    # And it is too small: by the mean of the blocks, and by what is cut at their ends.
    kept = (1 - 1 / blocks) * min(_kept(signal, length) for signal in (first, second))
    wider = float(stdtrit(blocks - 1, 0.975) / 1.96 / np.sqrt(kept))
    ratios = ratio * np.exp(wider * np.log(np.sqrt(drawn[1] / drawn[0]) / ratio))
    low, high = (float(q) for q in np.quantile(ratios, [0.025, 0.975]))
    change = Change.NO_DIFFERENCE
    if high < 1 or low > 1:
        change = Change.BETTER if high < 1 else Change.WORSE
    share = (first.size + second.size) / (before.size + after.size)
    doubts = () if blocks >= 3 * FEWEST_BLOCKS else (f"only {blocks} blocks in one period",)
    return BeforeAfter(
        change=change,
        ratio=ratio,
        low=low,
        high=high,
        probability=float(np.mean(ratios < 1)),
        block=length,
        basis=graded(share, doubts, settings=settings),
    )


def _not_comparable(why: str, length: int, settings: tuple[tuple[str, float], ...]) -> BeforeAfter:
    return BeforeAfter(
        change=Change.NOT_COMPARABLE, ratio=None, low=None, high=None, probability=None,
        block=length, basis=refusal(why, settings=settings),
    )  # fmt: skip


def _memory(error: Real) -> int:
    """Three times the lag at which the autocorrelation is gone, or an oscillation's has faded."""
    if error.size < 2 * FEWEST_BLOCKS or not np.ptp(error) > 0:
        return max(int(error.size), 1)
    r = autocovariance(error, max(error.size // FEWEST_BLOCKS, 1))
    small = np.abs(r) <= GONE * r[0]
    first = int(np.argmax(small)) if small.any() else int(r.size)
    last = int(np.flatnonzero(np.abs(r) > FADED * r[0])[-1]) + 1
    root: int = round(float(error.size) ** (1 / 3))
    return max(3 * max(first, last), root)


def _kept(error: Real, length: int) -> float:
    """Part of the variance of a mean square that blocks of a length keep, half at least.

    The autocovariance of the square of a Gaussian signal with mean m and autocovariance c is
    2 c^2 + 4 m^2 c; a block cuts off its part k/length at lag k.
    """
    if length < 2:
        return 1.0
    c = autocovariance(error, length - 1)
    r = c**2 + 2 * float(np.mean(error)) ** 2 * c
    lags = np.arange(length)
    return max(1 - 2 * float(lags @ r) / length / float(2 * np.sum(r) - r[0]), 0.5)


def _drawn(squares: Real, length: int, draws: int, rng: np.random.Generator) -> Real:
    """Mean squares of series drawn block by block around the circle."""
    n = squares.size
    sums = np.cumsum(np.r_[0.0, squares, squares[:length]])
    blocks = sums[length : length + n] - sums[:n]
    starts = rng.integers(0, n, (draws, -(-n // length)))
    return np.asarray(np.maximum(blocks[starts].mean(axis=1) / length, np.finfo(float).tiny))
