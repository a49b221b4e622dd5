"""Processes that a record cannot tell from its model, for settings that must suit them all."""

from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from identification.draws import parameter_draws
from identification.even_record import even_record
from identification.even_stretches import Stretch
from identification.identify import Identification
from identification.prediction_error import PredictionErrorFit, prediction_error_fit
from identification.verdict import Verdict
from loop.batch import ProcessBatch
from loop.errors import LoopError
from loop.process import FOPDT, IPDT, LARGEST, SMALLEST, SOPDT, Process, PureDelay
from loop.record import Record
from loop.signals import Real
from tuning.answer import Tunings
from tuning.withstanding import withstanding

# Draws, and the seed that gives the same ones for the same record.
DRAWS, SEED = 200, 0
# A parameter's factor either way that a draw may have.
FURTHEST = 30.0
# Where each parameter stands in a row of K, tau1, tau2, theta, integrators.
COLUMNS = {"K": 0, "tau": 1, "tau1": 1, "tau2": 2, "theta": 3}
# A gap of more than so many samples before a move hides when it happened.
GAP = 1.5
# The whitened fit speaks against the model beyond so many of its errors, and where it matters.
CERTAIN, MATTERS = 3.0, 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rivals:
    """Processes that explain a record too.

    Attributes
    ----------
    processes : ProcessBatch, shape (n,)
        All of them.
    notes : tuple of str
        Readings of the record other than its model, in words.
    """

    processes: ProcessBatch
    notes: tuple[str, ...]


def rivals(record: Record, model: Identification) -> Rivals | None:
    """Collect what else a record may mean: its errors, a late move, a wandering disturbance.

    Parameters
    ----------
    record : Record
        What was identified.
    model : Identification
        The model, not refused.

    Returns
    -------
    Rivals or None
        None where nothing is known of the model's errors.
    """
    process = model.process
    if not isinstance(process, FOPDT | SOPDT | IPDT | PureDelay):
        return None
    late = _late(record, model)
    rows = _draws(model, process)
    notes = []
    if late > 0:
        moved = rows.copy()
        moved[:, 3] += late
        rows = np.concatenate((rows, moved))
        notes.append(f"OP may have moved {late:.3g} s before the sample that shows it")
    other = _whitened(record) if model.steps else None
    if other is not None and _disagrees(process, other):
        rows = np.concatenate((rows, [[other.K, other.tau, 0.0, other.theta, 0.0]]))
        notes.append(
            f"taking what the model misses for a wandering disturbance, the process would be "
            f"K {other.K:.3g}, tau {other.tau:.3g} s, theta {other.theta:.3g} s"
        )
    rows[:, 1:3] = np.where(rows[:, 1:3] > 0, np.clip(rows[:, 1:3], SMALLEST, LARGEST), 0.0)
    return Rivals(
        processes=ProcessBatch(
            K=rows[:, 0],
            tau1=rows[:, 1],
            tau2=rows[:, 2],
            integrators=rows[:, 4].astype(np.intp),
            theta=rows[:, 3],
        ),
        notes=tuple(notes),
    )


def for_all_readings(
    answer: Tunings, process: Process, record: Record, model: Identification, scan_time: float
) -> Tunings:
    """Hold the recommendation to all that the record may mean besides its model.

    A model that is trusted, and that no other reading of its record contradicts, leaves the answer
    as it is.

    Parameters
    ----------
    answer : Tunings
        Every rule's answer for the model.
    process : Process
        The model.
    record : Record
        What was identified.
    model : Identification
        The model with its verdict.
    scan_time : float
        Scan time of the controller. [s]
    """
    found = rivals(record, model)
    if found is None or (model.verdict is Verdict.TRUSTED and not found.notes):
        return answer
    held = withstanding(answer, process, found.processes, sample_time=scan_time)
    notes = (f"Taken into account: {note}." for note in found.notes)
    said = " ".join((held.recommendation.reason, *notes))
    return replace(held, recommendation=replace(held.recommendation, reason=said))


def _draws(model: Identification, process: FOPDT | SOPDT | IPDT | PureDelay) -> Real:
    """Rows K, tau1, tau2, theta, integrators: the model first, then draws where errors are known.

    What the errors of a simplified structure are is not known; the model then stands alone.
    """
    try:
        if model.structure is None:
            drawn = _first_order_draws(model)
        else:
            drawn = parameter_draws(model, n=DRAWS, seed=SEED)
    except ValueError:
        drawn = np.zeros((0, 3))
    own = astuple(process)
    place = [COLUMNS[item.name] for item in fields(process)]
    if drawn.shape[1] != len(own):
        drawn = np.zeros((0, len(own)))
    rows = np.zeros((1 + drawn.shape[0], 5))
    rows[:, place] = np.concatenate((np.array([own]), drawn))
    rows[:, 4] = isinstance(process, IPDT)
    return rows


def _first_order_draws(model: Identification) -> Real:
    """K, tau, theta of a fit in closed loop, drawn like `parameter_draws`."""
    fitted, errors, correlation = model.fitted, model.standard_errors, model.correlation
    if not isinstance(fitted, FOPDT) or errors is None or correlation is None:
        raise ValueError("draws need a fitted first-order model with errors")
    scale = np.array([fitted.K, fitted.tau, 1.0])
    spread = correlation * np.outer(errors / scale, errors / scale)
    sizes, directions = np.linalg.eigh(spread)
    root = directions * np.sqrt(np.maximum(sizes, 0.0))
    off = np.random.default_rng(SEED).standard_normal((DRAWS, 3)) @ root.T
    limit = float(np.log(FURTHEST))
    factors = np.exp(np.clip(off[:, :2], -limit, limit))
    theta = np.maximum(fitted.theta + off[:, 2], 0.0)
    return np.column_stack((scale[:2] * factors, theta))


def _late(record: Record, model: Identification) -> float:
    """Longest time before a move in which it may already have happened. [s]"""
    known = np.flatnonzero(np.isfinite(record.pv) & np.isfinite(record.op))
    t = record.t[known]
    usual = float(np.median(np.diff(t)))
    holes = [0.0]
    for reading in model.steps:
        row = int(np.searchsorted(t, reading.step.start))
        if 0 < row < t.size:
            holes.append(float(t[row] - t[row - 1]))
    return max(holes) if max(holes) > GAP * usual else 0.0


def _whitened(record: Record) -> PredictionErrorFit | None:
    """The record in manual fitted with a noise model, None where that cannot be."""
    try:
        even = even_record(record)
    except LoopError:
        return None
    manual = even.known if record.mode is None else even.known & ~even.automatic
    edges = np.flatnonzero(np.diff(manual.astype(int), prepend=0, append=0)).tolist()
    stretches = tuple(
        Stretch(pv=even.pv[a:b], op=even.op[a:b])
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a >= 60
    )
    if not stretches or not any(np.ptp(s.op) > 0 for s in stretches):
        return None
    longest = max(s.pv.size for s in stretches) * even.dt
    return prediction_error_fit(stretches, even.dt, slowest=longest, latest=longest / 3)


def _disagrees(process: FOPDT | SOPDT | IPDT | PureDelay, other: PredictionErrorFit) -> bool:
    """Whether the other fit, where it is sure of itself, calls for other settings."""
    errors = other.standard_errors
    if not (errors[0] < abs(other.K) / 2 and errors[1] < other.tau / 2):
        return False
    if isinstance(process, IPDT):
        slope, theirs = process.K, other.K / other.tau
        return abs(theirs / slope - 1) > 2 * MATTERS
    lags: tuple[float, ...] = (process.tau,) if isinstance(process, FOPDT) else ()
    if isinstance(process, SOPDT):
        lags = (process.tau1, process.tau2)
    lag = sum(lags)
    off = np.array(
        [other.K - process.K, other.tau + other.theta - lag - process.theta,
         other.theta - process.theta]
    )  # fmt: skip
    size = np.array([abs(process.K), lag + process.theta, lag + process.theta])
    sure = np.array([errors[0], float(np.hypot(errors[1], errors[2])), errors[2]])
    return bool(np.any((np.abs(off) > CERTAIN * sure) & (np.abs(off) > MATTERS * size)))
