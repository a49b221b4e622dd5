"""Scatter of the FOPDT fit over many seeds against the smallest that any method can have."""

import math

import numpy as np

from benchmarks.fopdt_fit import distance, with_loopwright
from benchmarks.section import Section, Target
from benchmarks.step_tests import STEP, StepTest, heater_test, random_test
from loop.signals import Real

SEEDS = 1_000
SIZES = (200, 2_000)
PARAMETERS = ("K", "tau", "theta")


def cramer_rao_bound(test: StepTest) -> Real:
    """Variance that no unbiased estimate of K, tau and theta goes below, rest and drift unknown.

    var >= diag((J^T J)^-1) noise^2 with J the derivatives of the response in closed form.

    Parameters
    ----------
    test : StepTest
        Times, truth and noise.

    Returns
    -------
    ndarray, shape (3,)
    """
    since = test.t - test.at - test.theta
    moving = since > 0
    left = np.where(moving, np.exp(-np.maximum(since, 0.0) / test.tau), 1.0)
    push = test.K * STEP
    J = np.column_stack(
        [
            STEP * (1 - left),
            np.where(moving, -push * left * since / test.tau**2, 0.0),
            np.where(moving, -push * left / test.tau, 0.0),
            np.ones_like(test.t),
            test.t,
        ]
    )
    scale = np.linalg.norm(J, axis=0)
    variances = np.diag(np.linalg.inv((J / scale).T @ (J / scale))) / scale**2
    return np.asarray(variances[:3] * test.noise**2)


def run() -> Section:
    """Fit the heater and random processes under a thousand noises each."""
    rows, targets = [], []
    sampling_error = math.sqrt(2 / SEEDS)
    for n in SIZES:
        found = np.array([with_loopwright(heater_test(n, seed))[:3] for seed in range(SEEDS)])
        test = heater_test(n, 0)
        truth = np.array([test.K, test.tau, test.theta])
        ratios = np.mean((found - truth) ** 2, axis=0) / cramer_rao_bound(test)
        failed = sum(distance(random_test(n, seed), with_loopwright) > 1 for seed in range(SEEDS))
        bias = np.mean(found - truth, axis=0) / np.sqrt(cramer_rao_bound(test) / SEEDS)
        rows.append(
            (
                f"{n:,}",
                *(f"{ratio:.2f} ± {ratio * sampling_error:.2f}" for ratio in ratios),
                ", ".join(f"{z:+.1f}" for z in bias),
                f"{failed} of {SEEDS:,}",
            )
        )
        worst = int(np.argmax(ratios))
        targets += [
            Target(
                what=f"{n:,} samples, largest MSE over bound ({PARAMETERS[worst]})",
                limit=1 + 3 * round(sampling_error, 3),
                reached=float(ratios[worst]),
                unit="",
            ),
            Target(what=f"{n:,} samples, failures", limit=0.0, reached=float(failed), unit=""),
        ]
    return Section(
        title="FOPDT fit against the Cramér-Rao bound",
        how=(
            f"Mean square error over {SEEDS:,} noises on the same step test, divided by the "
            "Cramér-Rao bound (drift and rest unknown), with the sampling error of that ratio; "
            "the mean error in units of its own standard error; and the failures (RMSE of the "
            f"response above one standard deviation of the noise) over {SEEDS:,} random processes."
        ),
        columns=("samples", "K", "tau", "theta", "bias of K, tau, theta", "failed"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            "A ratio of 1 is the best that any unbiased method can reach; the target allows three "
            "sampling errors.",
        ),
    )
