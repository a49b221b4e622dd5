"""FOPDT fit of a step test against scipy's curve_fit and gekko, from good and default starts."""

import math
import warnings
from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np
from gekko import GEKKO
from scipy.optimize import OptimizeWarning, curve_fit

from benchmarks.section import Section, Target
from benchmarks.step_tests import REST, StepTest, answer, heater_test, random_test
from benchmarks.timing import Work, duration, interleaved
from identification.held_input import HeldInput
from identification.least_squares import fopdt_least_squares

Fit: TypeAlias = tuple[float, ...]
Fitter: TypeAlias = Callable[[StepTest], Fit]
SIZES = (200, 2_000, 20_000)
# What a fit may take. [ms]
MOST_TIME = {200: 0.3, 2_000: 0.4, 20_000: 0.6}
SEEDS = 50
# Off the truth by these factors, as an engineer's eye would be.
GOOD_START = (0.8, 1.25, 0.8)


def with_loopwright(test: StepTest, *, drift: bool = True) -> Fit:
    """Fit K, tau, theta, rest and drift, with standard errors; no start is needed."""
    held = HeldInput.from_samples(test.t, test.op)
    fit = fopdt_least_squares(test.t, test.pv, held, drift=drift)
    assert np.all(np.isfinite(fit.standard_errors))
    return fit.K, fit.tau, fit.theta, fit.pv0, fit.drift


def _good_start(test: StepTest) -> list[float]:
    truth = (test.K, test.tau, test.theta)
    return [true * off for true, off in zip(truth, GOOD_START, strict=True)] + [test.pv[0]]


def _curve_fit(test: StepTest, start: list[float] | None, *, drift: bool) -> Fit:
    if drift:
        found, _ = curve_fit(partial(answer, at=test.at), test.t, test.pv, p0=start or [1.0] * 5)
        return tuple(float(x) for x in found)
    model = partial(answer, drift=0.0, at=test.at)
    found, _ = curve_fit(model, test.t, test.pv, p0=start or [1.0] * 4)
    return (*(float(x) for x in found), 0.0)


def with_good_start(test: StepTest) -> Fit:
    """Fit the same five parameters with scipy from a start within 25 % of the truth."""
    return _curve_fit(test, [*_good_start(test), 0.0], drift=True)


def without_drift(test: StepTest) -> Fit:
    """Leave the drift out, so that scipy has one parameter less."""
    return _curve_fit(test, _good_start(test), drift=False)


def with_default_start(test: StepTest) -> Fit:
    """Start where curve_fit starts when told nothing: every parameter 1."""
    return _curve_fit(test, None, drift=False)


def with_gekko(test: StepTest) -> Fit:
    """Estimate K, tau and rest with gekko's dynamic estimation, its dead time given as known."""
    model = GEKKO(remote=False)
    model.time = test.t
    op = model.Param(value=np.where(test.t >= test.at + test.theta, test.op[-1], 0.0))
    pv = model.Param(value=test.pv)
    start = _good_start(test)
    K = model.FV(start[0], lb=0.05 * start[0], ub=20 * start[0])
    tau = model.FV(start[1], lb=0.05 * start[1], ub=20 * start[1])
    rest = model.FV(start[3], lb=0.0, ub=2 * REST)
    x = model.Var(0.0)
    for free in (K, tau, rest):
        free.STATUS = 1
    model.Equation(tau * x.dt() == -x + K * op)
    model.Minimize((pv - x - rest) ** 2)
    model.options.IMODE = 5
    model.options.NODES = 2
    model.solve(disp=False)
    model.cleanup()
    return K.value[0], tau.value[0], test.theta, rest.value[0], 0.0


FITTERS: dict[str, Fitter] = {
    "Loopwright": with_loopwright,
    "Loopwright, no drift": partial(with_loopwright, drift=False),
    "scipy curve_fit, good start": with_good_start,
    "scipy curve_fit, good start, no drift": without_drift,
    "scipy curve_fit, default start, no drift": with_default_start,
}


def distance(test: StepTest, fit: Fitter) -> float:
    """RMSE of the fitted response against the true one, infinite where the fit gave none.

    Parameters
    ----------
    test : StepTest
        Data with truth.
    fit : callable
        Way to fit.

    Returns
    -------
    float
        In standard deviations of the noise. [-]
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OptimizeWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            found = answer(test.t, *fit(test), at=test.at)
        except RuntimeError:  # curve_fit's way to say that it did not converge
            return math.inf
        miss = math.sqrt(float(np.mean((found - test.true_pv) ** 2))) / test.noise
    return miss if math.isfinite(miss) else math.inf


def _try(fit: Fitter, test: StepTest) -> Fit | None:
    try:
        return fit(test)
    except RuntimeError:
        return None


def run() -> Section:
    """Measure at three lengths, then count failures over random processes."""
    rows, targets = [], []
    for n in SIZES:
        tests = [random_test(n, seed) for seed in range(SEEDS)]
        fitters = dict(FITTERS)
        if n == SIZES[0]:
            fitters["gekko, dead time given"] = with_gekko
        test = heater_test(n, 1)
        works: dict[str, Work] = {name: partial(_try, fit, test) for name, fit in fitters.items()}
        timings = interleaved(works, repeats=15, seconds=6.0)
        for name, fit in fitters.items():
            few = tests if name in FITTERS else []
            misses = [distance(one, fit) for one in few]
            failed = f"{sum(miss > 1 for miss in misses)} of {len(few)}" if few else "not counted"
            timing = timings[name]
            time = f"{duration(timing.median)} ({duration(timing.best)})"
            rows.append((f"{n:,}", name, time, f"{distance(test, fit):.3f}", failed))
        targets += [
            Target(
                what=f"{n:,} samples{kind}, shortest time",
                limit=MOST_TIME[n],
                reached=1e3 * timings[f"Loopwright{kind}"].best,
                unit="ms",
            )
            for kind in ("", ", no drift")
        ]
        if n == SIZES[-1]:
            targets += [
                Target(
                    what=f"{n:,} samples{kind}, against curve_fit with a good start",
                    limit=20.0,
                    reached=timings[f"scipy curve_fit, good start{kind}"].median
                    / timings[f"Loopwright{kind}"].median,
                    unit="times",
                    at_least=True,
                )
                for kind in ("", ", no drift")
            ]
    return Section(
        title="FOPDT fit of a step test",
        how=(
            "Time to fit one noisy step test (noise 1.5 % of the change of PV) and the RMSE of "
            "the fitted response against the true one, in standard deviations of the noise: "
            f"sqrt(5/n) is what five free parameters cost. Failed: RMSE above 1, over {SEEDS} "
            "random processes (theta/tau 0.1 to 2)."
        ),
        columns=("samples", "by", "time", "RMSE", "failed"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            "Loopwright and curve_fit with a good start fit K, tau, theta, rest and drift with "
            "their covariance. curve_fit is told the exact form of the step and starts within "
            "25 % of the truth; Loopwright reads the step from the record and starts from nothing.",
            "gekko has no unknown dead time: it is given the true one, estimates three parameters "
            "without standard errors, and takes seconds at 2,000 samples.",
        ),
    )
