"""The quick look at every loop: which ones deserve the full assessment."""

from dataclasses import dataclass

import numpy as np

from monitoring.bicoherence import Bicoherence, bicoherence
from monitoring.cross_correlation import CrossCorrelation, cross_correlation
from monitoring.loop_signals import Stretch
from monitoring.minimum_variance import MinimumVariance, minimum_variance
from monitoring.oscillation import Oscillation, oscillation

# The cross-correlation needs a period; without an oscillation it looks this far. [samples]
USUAL_PERIOD = 64.0
CROSS_SAMPLES = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Screening:
    """Four indices in a few milliseconds.

    Attributes
    ----------
    oscillation : Oscillation
        The strongest oscillation of the whole record; weaker ones and those of a part of it are
        left to the full assessment.
    minimum_variance : MinimumVariance
        Minimum-variance index at the delay given.
    cross_correlation : CrossCorrelation or None
        Shape of the cross-correlation, from the last 8,192 samples.
    bicoherence : Bicoherence or None
        Non-Gaussianity and non-linearity, from the last 4,096 samples.
    flagged : bool
        Worth the full assessment: it oscillates, its error is non-linear, or far from the best.
    """

    oscillation: Oscillation
    minimum_variance: MinimumVariance
    cross_correlation: CrossCorrelation | None
    bicoherence: Bicoherence | None
    flagged: bool


def screen(stretch: Stretch, *, delay: int = 1, eta_least: float = 0.3) -> Screening:
    """Look at a loop quickly.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    delay : int
        Delay for the minimum-variance index. [samples]
    eta_least : float
        Index below which the loop is flagged. [-]
    """
    error = stretch.error
    swings = oscillation(error, stretch.dt, share=stretch.share, segments=False, most=1)
    main = swings.main
    period = USUAL_PERIOD if main is None else main.period / stretch.dt
    best = minimum_variance(error, delay=delay, share=stretch.share)
    recent = slice(-max(CROSS_SAMPLES, min(int(8 * period), error.size)), None)
    odd = None
    if np.ptp(stretch.op[recent]) > 0:
        odd = cross_correlation(stretch.op[recent], stretch.pv[recent], period)
    gaussian = bicoherence(error)
    poor = best.eta is not None and best.eta < eta_least
    nonlinear = gaussian is not None and gaussian.nonlinear
    return Screening(
        oscillation=swings,
        minimum_variance=best,
        cross_correlation=odd,
        bicoherence=gaussian,
        flagged=swings.oscillates or poor or nonlinear,
    )
