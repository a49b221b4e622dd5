"""Answer of a process to a controller output that somebody moved."""

from itertools import accumulate

import numpy as np

from loop.process import Process
from loop.sampled_process import motion, state_space
from loop.signals import Real

# Intervals that differ by less than this part of the whole span are rounding, not sampling.
SAME_INTERVAL = 2.0**-46


def process_output(
    process: Process, t: Real, op: Real, *, op_before: float | None = None, pv0: float = 0.0
) -> Real:
    """Answer to an output that holds op[k] from t[k] on, exact at every sample.

    The process rests at `pv0` with the output at `op_before`. Samples may be uneven. A move that
    arrives between two samples, because of the dead time, is taken at its own instant.

    Parameters
    ----------
    process : Process
        Process model.
    t : ndarray, shape (n,)
        Times of the samples, strictly increasing. [s]
    op : ndarray, shape (n,)
        Controller output, held until the next sample. [OP]
    op_before : float, optional
        Output before the first sample; op[0] if not given, a process at rest. [OP]
    pv0 : float
        Process variable at rest. [PV]

    Returns
    -------
    ndarray, shape (n,)
        Process variable. [PV]

    Raises
    ------
    ValueError
        Times do not increase, or a value is missing.

    Notes
    -----
    x(t + h) = e^(A h) x(t) + u int_0^h e^(A s) B ds between any two instants at which the input
    of the rational part or the output is due.
    """
    t, op = np.asarray(t, dtype=np.float64), np.asarray(op, dtype=np.float64)
    _check(t, op)
    before = float(op[0]) if op_before is None else op_before
    moves = op - before
    space = state_space(process)
    arrivals = t + process.theta
    events = np.unique(np.concatenate([t, arrivals[arrivals < t[-1]]]))
    held = np.concatenate([[0.0], moves])[np.searchsorted(arrivals, events, side="right")]
    x = _states(space.A, space.B, np.diff(events), held[:-1])
    wanted = np.searchsorted(events, t)
    return np.asarray(pv0 + x[wanted] @ space.C + space.D * held[wanted])


def step_response(process: Process, t: Real) -> Real:
    """Answer to a unit step of the output at t = 0. [PV]

    Parameters
    ----------
    process : Process
        Process model.
    t : ndarray, shape (n,)
        Times, from 0 on, strictly increasing. [s]
    """
    t = np.asarray(t, dtype=np.float64)
    if t.size == 0 or t[0] < 0:
        raise ValueError("a step response needs times from 0 on")
    late = t[0] > 0
    grid = np.concatenate([[0.0], t]) if late else t
    return process_output(process, grid, np.ones_like(grid), op_before=0.0)[int(late) :]


def _check(t: Real, op: Real) -> None:
    if t.ndim != 1 or t.shape != op.shape or t.size == 0:
        raise ValueError(f"t and op must be equally long lists, got shapes {t.shape}, {op.shape}")
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(op))):
        raise ValueError("t and op must not have gaps; close or cut them first")
    if np.any(np.diff(t) <= 0):
        raise ValueError("times must increase strictly")


def _states(A: Real, B: Real, intervals: Real, held: Real) -> Real:
    """States at every event, from rest; one row an event."""
    n = B.size
    if intervals.size == 0:
        return np.zeros((1, n))
    _, first, kind = np.unique(
        np.round(intervals / (intervals.sum() * SAME_INTERVAL)),
        return_index=True,
        return_inverse=True,
    )
    lengths = intervals[first]
    Phi, Gamma = motion(
        np.broadcast_to(A, (lengths.size, n, n)), np.broadcast_to(B, (lengths.size, n)), lengths
    )
    pushes = Gamma[kind] * held[:, None]
    if n == 1:
        decays = Phi[kind, 0, 0].tolist()
        steps = zip(decays, pushes[:, 0].tolist(), strict=True)
        states = accumulate(steps, lambda x, step: step[0] * x + step[1], initial=0.0)
        return np.fromiter(states, dtype=np.float64, count=intervals.size + 1)[:, None]
    x = np.zeros((intervals.size + 1, n))
    for k, push in enumerate(pushes):
        x[k + 1] = Phi[kind[k]] @ x[k] + push
    return x
