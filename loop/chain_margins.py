"""Margins of many controllers on one process that is a chain of real factors."""

from dataclasses import replace

import numpy as np

from loop.batch import MarginBatch, PIDBatch, ProcessBatch
from loop.controller import PID
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.lag_chain import LagChain, lag_chain
from loop.lag_loops import LagLoops
from loop.margins import margins
from loop.process import LARGEST, Process, rational_response
from loop.scan_batch import scan_margins

# Frequencies, over the corners of a chain, at which it must be the process it came
# from: a multiple pole has its digits halved.
PROBES, SAME = np.geomspace(1e-2, 1e2, 60), 1e-6


def full_margins(
    process: Process, controllers: tuple[PID, ...], *, sample_time: float = 0.0
) -> MarginBatch:
    """Find the margins of every controller on a process of any order, with exact dead time.

    A chain of real factors goes through the batch, another process loop by loop.

    Parameters
    ----------
    process : Process
        Process model. [s]
    controllers : tuple of PID, length n
        Controllers.
    sample_time : float
        Scan time of the controllers; half of it counts as dead time. [s]

    Returns
    -------
    MarginBatch, shape (n,)
        Margins; of an unstable loop 0, and infinite for Ms and Mt.

    Raises
    ------
    ValueError
        The sample time lies outside 0 to 1e9 s.
    """
    if not 0 <= sample_time <= LARGEST:
        raise ValueError(f"sample_time must lie within 0 and {LARGEST:g} s, got {sample_time}")
    chain = _exact_chain(process)
    if chain is None:
        return _one_by_one(process, controllers, sample_time)
    loops = _loops(chain, controllers, sample_time)
    level = (loops.theta == 0) & (loops.excess <= 0)
    if level.any():  # ends on the real axis, which the batch leaves to the scalar
        return _one_by_one(process, controllers, sample_time)
    return scan_margins(loops)


def _exact_chain(process: Process) -> LagChain | None:
    """The factors, where they are real and give the process back."""
    try:
        chain = lag_chain(process)
    except RuleNotApplicable:
        return None
    corners = [abs(T) for T in (*chain.lags, *chain.leads, *chain.inverse)] or [1.0]
    s = 1j * PROBES / np.exp(np.mean(np.log(corners)))
    product = chain.K / s**chain.integrators
    for T in (*chain.leads, *chain.inverse):
        product = product * (T * s + 1)
    for T in chain.lags:
        product = product / (T * s + 1)
    same = np.abs(product / rational_response(process, s) - 1).max() < SAME
    return chain if same else None


def _loops(chain: LagChain, controllers: tuple[PID, ...], sample_time: float) -> LagLoops:
    gain = ProcessBatch(
        K=np.asarray(chain.K),
        tau1=np.asarray(0.0),
        tau2=np.asarray(0.0),
        integrators=np.asarray(chain.integrators),
        theta=np.asarray(chain.theta),
    )
    batch = PIDBatch.stacked(controllers)
    loops = LagLoops.of(gain, batch, np.asarray(sample_time / 2), batch.shape)
    same = np.ones(loops.size)
    return replace(
        loops,
        lags=(*loops.lags, *(T * same for T in chain.lags)),
        leads=tuple(T * same for T in (*chain.leads, *chain.inverse)),
    )


def _one_by_one(process: Process, controllers: tuple[PID, ...], sample_time: float) -> MarginBatch:
    n = len(controllers)
    found = MarginBatch(
        stable=np.zeros(n, dtype=bool),
        gain=np.zeros(n),
        gain_reduction=np.zeros(n),
        phase=np.zeros(n),
        delay=np.zeros(n),
        Ms=np.full(n, np.inf),
        Mt=np.full(n, np.inf),
    )
    for row, pid in enumerate(controllers):
        try:
            one = margins(process, pid, sample_time=sample_time)
        except UnstableLoop:
            continue
        found.stable[row] = True
        for name in ("gain", "gain_reduction", "phase", "delay", "Ms", "Mt"):
            getattr(found, name)[row] = getattr(one, name)
    return found
