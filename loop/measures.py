"""What a response is worth: speed, overshoot, settling, integrals of the error, work of the output.

Between samples the signals are straight lines: crossing times are interpolated, and the integrals
are exact for those lines.
"""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real

# The last twentieth of a response stands for its end, so that noise averages out.
END = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class StepMeasures:
    """How a loop followed a set-point step. Times count from the step.

    Attributes
    ----------
    rise_time : float or None
        First time at 90 % of the step minus first time at 10 %; none if 90 % was never reached. [s]
    overshoot : float
        Largest excess over the set point, 0 for none, in percent of the step. [%]
    settling_time : float or None
        Time after which PV stays within the band; none if it ends outside. [s]
    peak : float
        PV that lies farthest in the direction of the step. [PV]
    peak_time : float
        Time of the peak. [s]
    IAE, ISE, ITAE : float
        Integrals of |e|, e^2 and t |e|, e = sp - pv. [PV s], [PV^2 s], [PV s^2]
    total_variation : float
        Sum of all moves of the output. [OP]
    steady_error : float
        Set point minus mean PV over the last twentieth of the response. [PV]
    """

    rise_time: float | None
    overshoot: float
    settling_time: float | None
    peak: float
    peak_time: float
    IAE: float
    ISE: float
    ITAE: float
    total_variation: float
    steady_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadMeasures:
    """How a loop rejected a load. Times count from the load.

    Attributes
    ----------
    peak_deviation : float
        Largest distance of PV from the set point, with its sign. [PV]
    peak_time : float
        Time of the largest deviation. [s]
    settling_time : float or None
        Time after which PV stays within the band; none if it ends outside. [s]
    IAE, ISE, ITAE : float
        Integrals of |e|, e^2 and t |e|, e = sp - pv. [PV s], [PV^2 s], [PV s^2]
    total_variation : float
        Sum of all moves of the output. [OP]
    """

    peak_deviation: float
    peak_time: float
    settling_time: float | None
    IAE: float
    ISE: float
    ITAE: float
    total_variation: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorIntegrals:
    """Integrals of the error; see `error_integrals`."""

    IAE: float
    ISE: float
    ITAE: float


def step_measures(
    t: Real,
    pv: Real,
    op: Real,
    *,
    sp: float,
    pv0: float,
    at: float | None = None,
    op_before: float | None = None,
    band: float = 0.02,
) -> StepMeasures:
    """Measure the response to a set-point step.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, strictly increasing. [s]
    pv, op : ndarray, shape (n,)
        Process variable and output. [PV], [OP]
    sp : float
        Set point after the step. [PV]
    pv0 : float
        Steady PV, and set point, before the step. [PV]
    at : float, optional
        Time of the step; the first sample if not given. [s]
    op_before : float, optional
        Output before the step; the first sample kept if not given, and then the first move of the
        output is not counted. [OP]
    band : float
        Half-width of the settling band as part of the step. [-]

    Raises
    ------
    ValueError
        The response is too short, has gaps, or the set point does not move.
    """
    if sp == pv0 or not np.isfinite(sp - pv0):
        raise ValueError(f"the set point must move, got {pv0} before and {sp} after the step")
    _check_band(band)
    t, pv, op = _after(t, pv, op, at)
    progress = (pv - pv0) / (sp - pv0)
    top = int(np.argmax(progress))
    start, end = first_crossing(t, progress, 0.1), first_crossing(t, progress, 0.9)
    integrals = error_integrals(t, sp - pv)
    return StepMeasures(
        rise_time=None if start is None or end is None else end - start,
        overshoot=100 * max(float(progress[top]) - 1, 0.0),
        settling_time=settling_time(t, progress - 1, band),
        peak=float(pv[top]),
        peak_time=float(t[top]),
        IAE=integrals.IAE,
        ISE=integrals.ISE,
        ITAE=integrals.ITAE,
        total_variation=total_variation(op, before=op_before),
        steady_error=float(sp - np.mean(pv[t >= t[-1] - END * (t[-1] - t[0])])),
    )


def load_measures(
    t: Real,
    pv: Real,
    op: Real,
    *,
    sp: float,
    at: float | None = None,
    op_before: float | None = None,
    band: float = 0.02,
) -> LoadMeasures:
    """Measure the response to a load at a constant set point.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, strictly increasing. [s]
    pv, op : ndarray, shape (n,)
        Process variable and output. [PV], [OP]
    sp : float
        Set point. [PV]
    at : float, optional
        Time of the load; the first sample if not given. [s]
    op_before : float, optional
        Output before the load; the first sample kept if not given. [OP]
    band : float
        Half-width of the settling band as part of the peak deviation. [-]

    Raises
    ------
    ValueError
        The response is too short or has gaps.
    """
    if not np.isfinite(sp):
        raise ValueError(f"the set point must be finite, got {sp}")
    _check_band(band)
    t, pv, op = _after(t, pv, op, at)
    deviation = pv - sp
    top = int(np.argmax(np.abs(deviation)))
    integrals = error_integrals(t, deviation)
    return LoadMeasures(
        peak_deviation=float(deviation[top]),
        peak_time=float(t[top]),
        settling_time=settling_time(t, deviation, band * abs(float(deviation[top]))),
        IAE=integrals.IAE,
        ISE=integrals.ISE,
        ITAE=integrals.ITAE,
        total_variation=total_variation(op, before=op_before),
    )


def _check_band(band: float) -> None:
    if not 0 < band < 1:
        raise ValueError(f"band must lie between 0 and 1, got {band}")


def _after(t: Real, pv: Real, op: Real, at: float | None) -> tuple[Real, Real, Real]:
    """Signals from the event on, with an interpolated PV at its instant; times count from it."""
    t, pv, op = (np.asarray(signal, dtype=np.float64) for signal in (t, pv, op))
    if t.ndim != 1 or not t.shape == pv.shape == op.shape:
        raise ValueError(
            f"t, pv and op must be equally long lists, got shapes {t.shape}, {pv.shape}, {op.shape}"
        )
    if not all(np.all(np.isfinite(signal)) for signal in (t, pv, op)):
        raise ValueError("t, pv and op must not have gaps; close or cut them first")
    if np.any(np.diff(t) <= 0):
        raise ValueError("times must increase strictly")
    event = at if at is not None else float(t[0]) if t.size else 0.0
    later = t > event
    if np.count_nonzero(later) < 2 or event < t[0]:
        raise ValueError(
            f"a response needs a sample at or before its event at {event} s and two after it"
        )
    held = int(np.searchsorted(t, event, side="right")) - 1
    return (
        np.concatenate([[0.0], t[later] - event]),
        np.concatenate([[np.interp(event, t, pv)], pv[later]]),
        np.concatenate([[op[held]], op[later]]),
    )


def first_crossing(t: Real, signal: Real, level: float) -> float | None:
    """First time at which a signal that starts below the level reaches it, interpolated. [s]

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    signal : ndarray, shape (n,)
        Signal.
    level : float
        Level in the signal's unit.

    Returns
    -------
    float or None
        None if the level is never reached; the first time if the signal starts at or above it.
    """
    reached = np.flatnonzero(signal >= level)
    if reached.size == 0:
        return None
    k = int(reached[0])
    return float(t[0]) if k == 0 else _between(t, signal, k - 1, level)


def settling_time(t: Real, deviation: Real, band: float) -> float | None:
    """Time after which |deviation| stays within the band, interpolated; none if it ends outside.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    deviation : ndarray, shape (n,)
        Distance from the final value.
    band : float
        Half-width of the band, in the unit of the deviation.
    """
    outside = np.flatnonzero(np.abs(deviation) > band)
    if outside.size == 0:
        return float(t[0])
    k = int(outside[-1])
    if k == t.size - 1:
        return None
    return _between(t, deviation, k, float(np.copysign(band, deviation[k])))


def _between(t: Real, signal: Real, k: int, level: float) -> float:
    """Instant between samples k and k + 1 at which the straight line passes the level."""
    part = (level - signal[k]) / (signal[k + 1] - signal[k])
    return float(t[k] + part * (t[k + 1] - t[k]))


def error_integrals(t: Real, error: Real) -> ErrorIntegrals:
    """Integrate |e|, e^2 and t |e|, exactly for straight lines between the samples.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, from the event on. [s]
    error : ndarray, shape (n,)
        Error. [PV]
    """
    turns = np.flatnonzero(error[:-1] * error[1:] < 0)
    part = error[turns] / (error[turns] - error[turns + 1])
    zeros = t[turns] + part * (t[turns + 1] - t[turns])
    t, error = np.insert(t, turns + 1, zeros), np.insert(error, turns + 1, 0.0)
    size = np.abs(error)
    return ErrorIntegrals(
        IAE=float(np.trapezoid(size, t)), ISE=_parabolas(t, size, size), ITAE=_parabolas(t, t, size)
    )


def _parabolas(t: Real, a: Real, b: Real) -> float:
    """Integrate the product of two broken lines: Simpson's rule is exact for it."""
    middle = (a[:-1] + a[1:]) * (b[:-1] + b[1:])  # four times the product half-way
    return float(np.sum(np.diff(t) * (a[:-1] * b[:-1] + middle + a[1:] * b[1:])) / 6)


def total_variation(op: Real, *, before: float | None = None) -> float:
    """Sum all moves of the output, sum |op[k] - op[k-1]|. [OP]

    Parameters
    ----------
    op : ndarray, shape (n,)
        Controller output. [OP]
    before : float, optional
        Output before the first sample, whose move then counts too. [OP]
    """
    moves = float(np.sum(np.abs(np.diff(op))))
    return moves if before is None else moves + abs(float(op[0]) - before)
