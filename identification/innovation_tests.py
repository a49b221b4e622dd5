"""Whether what a closed-loop model leaves unexplained still follows what was done to the loop.

A set point moved by a person knows nothing of the disturbances, so what nothing foretells must not
follow it at any lag: the sharpest test of a model from closed-loop data. The output answers PV,
therefore only its past is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.even_record import EvenRecord
from identification.informative_segments import SegmentSearch
from identification.prediction_error import PredictionErrorFit
from identification.quality import BEYOND_CHANCE, residual_colour
from loop.signals import Real

# Lags looked at, in (tau + theta), and at most.
REACH, MOST_LAGS = 3.0, 60
TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """Largest correlation of the innovation with the past of a signal.

    Attributes
    ----------
    worst : float
        In its standard errors, with its sign. [-]
    lag : float
        Where. [s]
    lags : int
        Lags looked at.
    part : float
        How far the model is off after a unit move of the signal, beyond chance: the largest
        correlation of PV less model, less three standard errors. [PV/signal]
    """

    worst: float
    lag: float
    lags: int
    part: float


def set_point_crossing(
    fit: PredictionErrorFit, record: EvenRecord, search: SegmentSearch
) -> Crossing:
    """Correlate the innovation with the moves of the set point before it.

    z_k = sum_i d_i e[i + k]/(sd(e) sqrt(sum_i d_i^2)), d_i the move at i

    Parameters
    ----------
    fit : PredictionErrorFit
        Fit.
    record : EvenRecord
        What was fitted.
    search : SegmentSearch
        Its segments, one for each stretch.
    """
    moves = []
    for segment, s in zip(search.segments, fit.stretches, strict=True):
        sp = record.sp[segment.first : segment.first + s.pv.size * fit.by]
        known = record.automatic[segment.first : segment.first + sp.size] & np.isfinite(sp)
        change = np.diff(np.where(known, sp, np.nan), prepend=np.nan)
        change[~np.isfinite(change)] = 0.0
        moves.append(change.reshape(-1, fit.by).sum(axis=1))
    return _crossing(fit, moves)


def output_crossing(fit: PredictionErrorFit) -> Crossing:
    """Correlate the innovation with the moves of the output before it.

    Parameters
    ----------
    fit : PredictionErrorFit
        Fit.
    """
    return _crossing(fit, [np.diff(s.op[s.lead :], prepend=s.op[s.lead]) for s in fit.stretches])


def _crossing(fit: PredictionErrorFit, moves: list[Real]) -> Crossing:
    lags = min(max(round(REACH * (fit.tau + fit.theta) / fit.dt), 3), MOST_LAGS)
    left = [s.pv - p for s, p in zip(fit.stretches, fit.predicted, strict=True)]
    sums, size = _sums(list(fit.innovations), moves, lags)
    off, size_off = _sums(left, moves, lags)
    sd = float(np.std(np.concatenate(fit.innovations)))
    z = sums / np.sqrt(np.where(size > 0, size, np.inf)) / max(sd, TINY)
    every = np.concatenate(left)
    chance = float(np.std(every)) * residual_colour(every).inflation ** 0.5
    size_off = np.where(size_off > 0, size_off, np.inf)
    part = np.abs(off) / size_off - BEYOND_CHANCE * chance / np.sqrt(size_off)
    worst = int(np.argmax(np.abs(z)))
    return Crossing(
        worst=float(z[worst]),
        lag=(worst + 1) * fit.dt,
        lags=lags,
        part=max(float(part.max()), 0.0),
    )


def _sums(signals: Sequence[Real], moves: Sequence[Real], lags: int) -> tuple[Real, Real]:
    """Sums of move times signal k samples later, and of the squares of those moves."""
    inner, size = np.zeros(lags), np.zeros(lags)
    for e, moved in zip(signals, moves, strict=True):
        d = moved[moved.size - e.size :]
        for k in range(1, min(lags + 1, e.size)):
            inner[k - 1] += float(d[:-k] @ e[k:])
            size[k - 1] += float(d[:-k] @ d[:-k])
    return inner, size
