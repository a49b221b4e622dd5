"""Models from routine data in automatic, with known truth, against sippy, scipy and gekko."""

import math
import warnings
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from statistics import median
from typing import TypeAlias

import numpy as np
from gekko import GEKKO
from scipy.optimize import curve_fit
from scipy.signal import lfilter
from sippy_unipi import system_identification

from benchmarks.section import Section, Target
from benchmarks.timing import duration, interleaved, processor_time
from identification.closed_loop import identify_routine
from identification.even_record import even_record
from identification.informative_segments import find_segments
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.margins import margins
from loop.process import FOPDT
from loop.record import Record
from loop.signals import Real
from loop.simulation import simulate

Fit: TypeAlias = Callable[[Record], FOPDT]

TRUTH = FOPDT(K=1.0, tau=50.0, theta=15.0)
RUNNING = PID(Kc=1.2, Ti=50.0)
NOISE, RUNS = 0.03, 10
# Dead times that a scan looks at, in samples of 1 s.
DELAYS = range(26)
HOUR, DAY = 3_600, 86_400
MOVES_AN_HOUR = 6
GUESS = (0.5, 30.0)
# Of sippy's ARMAX.
MOST_ITERATIONS = 50


def routine(seconds: int, seed: int, *, every: int) -> Record:
    """Simulate routine operation at 1 s whose set point goes between 0 and 1.

    Parameters
    ----------
    seconds : int
        Length. [s]
    seed : int
        Of the noise.
    every : int
        Time between two moves of the set point. [s]
    """
    t = np.arange(float(seconds))
    run = simulate(
        TRUTH,
        RUNNING,
        t_end=seconds - 0.5,
        dt=1.0,
        sp=np.where(t // every % 2 == 1, 1.0, 0.0),
        noise=NOISE,
        rng=np.random.default_rng(seed),
    )
    return Record(t=run.t, sp=run.sp, pv=run.pv, op=run.op)


def with_loopwright(record: Record) -> FOPDT:
    """Find the moves, fit with a noise model, judge."""
    process = identify_routine(record).process
    assert isinstance(process, FOPDT)
    return process


def with_sippy(record: Record, *, method: str) -> FOPDT:
    """Fit a first-order ARX or ARMAX for every dead time; the least one-step error chooses."""
    orders = [1, 1, 1] if method == "ARMAX" else [1, 1]
    fits = []
    for delay in DELAYS:
        with redirect_stdout(StringIO()):  # it prints its warnings
            found = system_identification(
                record.pv,
                record.op,
                method,
                centering="MeanVal",
                ARX_orders=[*orders, delay],
                ARMAX_orders=[*orders, delay],
                max_iterations=MOST_ITERATIONS,
            )
        gain, pole = float(found.G.num[0][0][0]), -float(found.G.den[0][0][1])
        fits.append((float(found.Vn), delay, gain, pole))
    _, delay, gain, pole = min(fits)
    return FOPDT(K=gain / (1 - pole), tau=-1 / math.log(pole), theta=float(delay))


def _simulated(op: Real, K: float, tau: float, level: float) -> Real:
    pole = math.exp(-1 / max(tau, 1e-3))
    return np.asarray(level + K * lfilter([0.0, 1 - pole], [1.0, -pole], op))


def with_scipy(record: Record) -> FOPDT:
    """Fit the simulated answer by curve_fit for every dead time, as if the loop were open."""
    fits = []
    for delay in DELAYS:
        op = np.concatenate([np.zeros(delay), record.op[: record.op.size - delay]])
        (K, tau, level), _ = curve_fit(_simulated, op, record.pv, p0=(*GUESS, 0.0))
        left = record.pv - _simulated(op, K, tau, level)
        fits.append((float(left @ left), delay, float(K), float(tau)))
    _, delay, K, tau = min(fits)
    return FOPDT(K=K, tau=tau, theta=float(delay))


def with_gekko(record: Record) -> FOPDT:
    """Estimate K, tau and level with gekko's dynamic estimation, the dead time given as known."""
    delay = round(TRUTH.theta)
    model = GEKKO(remote=False)
    model.time = record.t
    op = model.Param(value=np.concatenate([np.zeros(delay), record.op[:-delay]]))
    pv = model.Param(value=record.pv)
    K, tau = model.FV(GUESS[0], lb=0.01, ub=100.0), model.FV(GUESS[1], lb=1.0, ub=1e4)
    level, x = model.FV(0.0, lb=-10.0, ub=10.0), model.Var(0.0)
    for free in (K, tau, level):
        free.STATUS = 1
    model.Equation(tau * x.dt() == -x + K * op)
    model.Minimize((pv - x - level) ** 2)
    model.options.IMODE = 5
    model.options.NODES = 2
    model.solve(disp=False)
    model.cleanup()
    return FOPDT(K=float(K.value[0]), tau=float(tau.value[0]), theta=float(delay))


FITS: dict[str, Fit] = {
    "Loopwright": with_loopwright,
    "sippy ARMAX, delays scanned, 3 runs": partial(with_sippy, method="ARMAX"),
    "sippy ARX, delays scanned": partial(with_sippy, method="ARX"),
    "scipy curve_fit of the simulation, delays scanned": with_scipy,
    "gekko, dead time given, 1 run": with_gekko,
}


# The slow ones are not asked for all runs.
FEWER = {"sippy ARMAX, delays scanned, 3 runs": 3, "gekko, dead time given, 1 run": 1}


def _peak(model: FOPDT) -> float:
    """Ms on the true process of SIMC's PI for a model; a dead time under a sample counts as one."""
    theta = max(model.theta, 1.0)
    Kc = model.tau / (model.K * 2 * theta)
    try:
        return margins(TRUTH, PID(Kc=Kc, Ti=min(model.tau, 8 * theta))).Ms
    except UnstableLoop:
        return math.inf


def _row(name: str, models: list[FOPDT], times: list[float]) -> tuple[str, ...]:
    peaks = [_peak(model) for model in models]
    stable = [peak for peak in peaks if peak < math.inf]
    span = f"{min(stable):.2f} to {max(stable):.2f}" if stable else "-"
    return (
        name,
        *(
            f"{min(values):.{digits}f} to {max(values):.{digits}f}"
            for values, digits in (
                ([model.theta for model in models], 1),
                ([model.K for model in models], 3),
                ([model.tau for model in models], 1),
            )
        ),
        span,
        f"{len(peaks) - len(stable)} of {len(peaks)}",
        f"{duration(median(times))} ({duration(min(times))})",
    )


def run() -> Section:
    """Fit ten runs by all ways, then time an hour and the search of a day."""
    records = [routine(1_500, seed, every=300) for seed in range(RUNS)]
    models: dict[str, list[FOPDT]] = {name: [] for name in FITS}
    times: dict[str, list[float]] = {name: [] for name in FITS}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for at, record in enumerate(records):
            for name, fit in FITS.items():
                if at >= FEWER.get(name, RUNS):
                    continue
                start = processor_time()
                models[name].append(fit(record))
                times[name].append(processor_time() - start)
    hour = routine(HOUR, 0, every=HOUR // MOVES_AN_HOUR)
    day = even_record(routine(DAY, 0, every=DAY // 12))
    ours = interleaved(
        {"hour": partial(identify_routine, hour), "day": partial(find_segments, day)},
        repeats=9,
        seconds=5.0,
    )
    peaks = [_peak(model) for model in models["Loopwright"]]
    return Section(
        title="Models from routine data in automatic",
        how=(
            f"{RUNS} runs of 1,500 s at 1 s, K {TRUTH.K:g}, tau {TRUTH.tau:g} s, theta "
            f"{TRUTH.theta:g} s under a PI with Kc {RUNNING.Kc:g} and Ti {RUNNING.Ti:g} s, four "
            f"moves of the set point by 1, noise of {100 * NOISE:g} %. What each takes the process "
            "for, and what SIMC's PI (tau_c = theta) for that model does on the true process. Time "
            "of one run."
        ),
        columns=("by", "theta [s]", "K", "tau [s]", "Ms", "unstable", "time"),
        rows=tuple(_row(name, models[name], times[name]) for name in FITS),
        targets=(
            Target(what="largest Ms from our models", limit=1.7, reached=max(peaks), unit=""),
            Target(
                what=f"fit and verdict of {HOUR:,} samples",
                limit=50.0,
                reached=1e3 * ours["hour"].median,
                unit="ms",
            ),
            Target(
                what="a day at 1 s searched for segments",
                limit=100.0,
                reached=1e3 * ours["day"].median,
                unit="ms",
            ),
        ),
        notes=(
            "sippy and scipy are told that the process is of first order; the dead time of 0 to "
            f"{DELAYS[-1]} samples with the least one-step error (sippy) or simulation error "
            "(scipy) is taken. They state no errors of K, tau and theta and refuse nothing.",
            "gekko has no unknown dead time: it is given the true one.",
        ),
    )
