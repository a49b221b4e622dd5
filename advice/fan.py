"""The same event on every process that the data allow."""

from dataclasses import astuple, dataclass, fields, replace
from itertools import product

import numpy as np

from loop.batch import LagProcess, ProcessBatch
from loop.controller import PID
from loop.experiment import Experiment
from loop.process import SOPDT, Process, TransferFunction
from loop.signals import Real
from loop.simulation_batch import run_batch

BAND = (0.05, 0.5, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fan:
    """Responses of one controller on many processes, without noise.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Instants. [s]
    low, median, high : ndarray, shape (n,)
        5 %, 50 % and 95 % quantiles of PV over the processes, scan by scan. [PV]
    least, most : ndarray, shape (n,)
        Smallest and largest PV. [PV]
    diverged : int
        Processes on which the loop grew without bound; they are not in the curves. [-]
    peak : tuple of float
        Quantiles of the largest |PV - PV at rest|. [PV]
    IAE : tuple of float
        Quantiles of the sum of |sp - pv| dt. [PV s]
    travel : tuple of float
        Quantiles of the sum of all moves of the output. [OP]
    """

    t: Real
    low: Real
    median: Real
    high: Real
    least: Real
    most: Real
    diverged: int
    peak: tuple[float, ...]
    IAE: tuple[float, ...]
    travel: tuple[float, ...]


def uncertain_processes(process: Process, draws: Real) -> ProcessBatch:
    """Make a batch of processes from draws of the parameters.

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT or DoubleIntegrator
        Process whose kind the draws have.
    draws : ndarray, shape (k, p)
        Parameters of each process, in the order of the kind's own.

    Raises
    ------
    ValueError
        The draws have another number of parameters, or one is impossible.
    """
    like = ProcessBatch.of(_of_lags(process))
    draws = np.asarray(draws, dtype=np.float64)
    names = [item.name for item in fields(process)]
    if draws.ndim != 2 or draws.shape[1] != len(names) or not draws.size:
        raise ValueError(
            f"draws of {type(process).__name__} have {len(names)} columns, {', '.join(names)}, "
            f"got the shape {draws.shape}"
        )
    own = dict(zip(names, draws.T, strict=True))
    return ProcessBatch(
        K=own["K"],
        tau1=own.get("tau", own.get("tau1", like.tau1)),
        tau2=own.get("tau2", like.tau2),
        integrators=like.integrators,
        theta=own["theta"],
    )


def _of_lags(process: Process) -> LagProcess:
    match process:
        case TransferFunction():
            raise ValueError(
                "a fan needs a process of lags and integrators, not a general transfer function"
            )
        case _:
            return process


def box_draws(process: Process, part: float, *, n: int = 100, seed: int = 1) -> Real:
    """Draw processes whose parameters are all off at once by up to a part, corners first.

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT or DoubleIntegrator
        Middle of the box.
    part : float
        Largest error of each parameter as part of it. [-]
    n : int
        Number of processes; the corners come first. [-]
    seed : int
        Seed of the rest.

    Returns
    -------
    ndarray, shape (n, p)
        Parameters in the order of the process's own.

    Raises
    ------
    ValueError
        The part does not lie between 0 and 1, or n is below 1.
    """
    process = _of_lags(process)
    if not 0 < part < 1:
        raise ValueError(f"the spread must lie between 0 and 1, got {part}")
    if n < 1:
        raise ValueError(f"the number of draws must be at least 1, got {n}")
    middle = np.array(astuple(process))
    corners = np.array(list(product((-1.0, 1.0), repeat=middle.size)))
    inside = np.random.default_rng(seed).uniform(-1.0, 1.0, (n, middle.size))
    draws = middle * (1 + part * np.concatenate([corners, inside])[:n])
    if isinstance(process, SOPDT):
        draws[:, 1:3] = -np.sort(-draws[:, 1:3], axis=1)  # the longer time constant first
    return np.asarray(draws)


def fan_of(processes: ProcessBatch, pid: PID, experiment: Experiment) -> Fan | None:
    """Run a controller on many processes; none where it grows without bound on all of them.

    Parameters
    ----------
    processes : ProcessBatch of shape (k,)
        Processes.
    pid : PID
        Controller settings.
    experiment : Experiment
        What is done to each of them; its noise is left out.
    """
    quiet = replace(experiment, noise=0.0)
    batch = run_batch(processes, [pid], quiet)
    kept = ~batch.diverged
    if not np.any(kept):
        return None
    pv, op = batch.true_pv[:, kept], batch.op[:, kept]
    low, median, high = np.quantile(pv, BAND, axis=1)
    moves = np.abs(np.diff(op, axis=0, prepend=experiment.op0))
    return Fan(
        t=batch.t,
        low=low,
        median=median,
        high=high,
        least=pv.min(axis=1),
        most=pv.max(axis=1),
        diverged=int(np.count_nonzero(batch.diverged)),
        peak=_quantiles(np.max(np.abs(pv - experiment.pv0), axis=0)),
        IAE=_quantiles(np.abs(batch.sp[:, None] - pv).sum(axis=0) * experiment.dt),
        travel=_quantiles(moves.sum(axis=0)),
    )


def _quantiles(values: Real) -> tuple[float, ...]:
    return tuple(np.quantile(values, BAND).tolist())
