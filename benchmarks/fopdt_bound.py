"""Scatter of the FOPDT fit over many seeds against the smallest that any method can have."""

import math

import numpy as np

from benchmarks.fopdt_cramer_rao import PARAMETERS, cramer_rao_bound
from benchmarks.fopdt_fit import distance, with_loopwright
from benchmarks.section import Section, Target
from benchmarks.step_tests import heater_test, random_test

SEEDS = 1_000
SIZES = (200, 2_000)


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
