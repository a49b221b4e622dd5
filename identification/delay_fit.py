"""Fit of a gain with dead time and no lag, whose sum of squares is flat between the samples.

Without a lag PV jumps one dead time after OP, and all dead times that put every jump between the
same two samples explain a record equally well. No derivative leads anywhere: the stretches between
those dead times are tried one by one, and the error of theta is the spread over them.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.condense import Samples
from identification.least_squares import LeastSquaresFit
from identification.structure_fit import StructureFit
from identification.structures import PURE_DELAY, design
from loop.signals import Real

# A lag is looked for without one where it is shorter than so many samples, or within two of its
# standard errors and small beside the dead time.
SAMPLES, UNSEEN, SMALL = 2.0, 2.0, 0.25
# Stretches of dead time that are tried; a test signal with hundreds of moves at odd times has more.
MOST_STRETCHES = 240
# A residual below this part of PV's range is arithmetic.
ROUNDING = 1e-7


def may_lack_lag(lag: float, error: float, theta: float, spacing: float) -> bool:
    """Whether a fitted lag is so short that there may be none.

    Parameters
    ----------
    lag, error : float
        Time constant, or the sum of two, and its standard error. [s]
    theta : float
        Dead time. [s]
    spacing : float
        Time between samples. [s]
    """
    return lag < SAMPLES * spacing or (lag < UNSEEN * error and lag < SMALL * theta)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stretch:
    """Dead times that explain the record equally well."""

    low: float
    high: float
    linear: Real
    sse: float

    @property
    def middle(self) -> float:
        return (self.low + self.high) / 2


def fit_delay(
    samples: Samples, fit: LeastSquaresFit, *, lag: float, theta: float
) -> StructureFit | None:
    """Fit a gain with dead time alone.

    Parameters
    ----------
    samples : Samples
        What the first-order model was fitted to.
    fit : LeastSquaresFit
        That fit: the output, and whether a drift is free.
    lag, theta : float
        Lag and dead time of the best fit with a lag: where to look. [s]

    Returns
    -------
    StructureFit or None
        None where no dead time within the record can be tried.
    """
    edges = _edges(samples.t, fit.held.instants, lag, theta)
    if edges.size < 2:
        return None
    root = np.ones_like(samples.t) if samples.weight is None else np.sqrt(samples.weight)
    tried = [_at(samples, fit, root, low, high) for low, high in pairwise(edges.tolist())]
    best = min(tried, key=lambda stretch: stretch.sse)
    shape = (best.middle,)
    about = root[:, None] * _columns(samples.t, fit, best.middle)
    freedom = max(int(np.sum(root**2)) - about.shape[1] - 1, 1)
    floor = root.size * (ROUNDING * float(np.ptp(samples.pv))) ** 2
    variance = max(best.sse, floor) / freedom
    scale = np.maximum(np.linalg.norm(about, axis=0), 1e-300)
    inner = np.linalg.pinv((about / scale).T @ (about / scale), hermitian=True)
    gain_variance = variance * float(inner[0, 0]) / scale[0] ** 2
    return StructureFit(
        structure=PURE_DELAY,
        values=(float(best.linear[0]), best.middle),
        covariance=np.diag([gain_variance, _theta_variance(tried, best, variance)]),
        linear=best.linear,
        shape=shape,
        sse=best.sse,
        free=about.shape[1] + 1,
        freedom=freedom,
        held=fit.held,
        t0=float(samples.t[0]),
        drift=fit.drift_fitted,
        start=False,
    )


def _edges(t: Real, instants: Real, lag: float, theta: float) -> Real:
    """Dead times at which a jump passes a sample, about the one that was found. [s]"""
    spacing = float(np.median(np.diff(t)))
    room = 3 * (lag + spacing)
    low, high = max(theta - room, 0.0), theta + lag + room
    passed = [np.array([low, high])]
    for instant in instants.tolist():
        a, b = t.searchsorted([instant + low, instant + high])
        passed.append(t[a:b] - instant)
    edges = np.unique(np.concatenate(passed))
    edges = edges[(edges >= low) & (edges <= high)]
    # On an even grid the same edge comes from every move, apart by rounding.
    edges = edges[np.diff(edges, prepend=-1.0) > 1e-6 * spacing]
    if edges.size > MOST_STRETCHES + 1:
        edges = edges[np.linspace(0, edges.size - 1, MOST_STRETCHES + 1).astype(np.intp)]
    return np.asarray(edges)


def _columns(t: Real, fit: LeastSquaresFit, theta: float) -> Real:
    return design(PURE_DELAY, fit.held, t, (theta,), drift=fit.drift_fitted, start=False)


def _at(samples: Samples, fit: LeastSquaresFit, root: Real, low: float, high: float) -> _Stretch:
    columns = root[:, None] * _columns(samples.t, fit, (low + high) / 2)
    y = samples.pv * root
    linear = np.linalg.lstsq(columns, y, rcond=1e-12)[0]
    left = y - columns @ linear
    return _Stretch(low=low, high=high, linear=linear, sse=float(left @ left))


def _theta_variance(tried: list[_Stretch], best: _Stretch, variance: float) -> float:
    """Mean square of theta about the best, each stretch as likely as its residual is. [s^2]"""
    low = np.array([stretch.low for stretch in tried])
    high = np.array([stretch.high for stretch in tried])
    off = np.array([stretch.sse for stretch in tried]) - best.sse
    chance = np.exp(-off / (2 * max(variance, 1e-300))) * (high - low)
    squares = ((high - best.middle) ** 3 - (low - best.middle) ** 3) / (3 * (high - low))
    return float(chance @ squares / chance.sum())
