"""Whether the stated errors of the FOPDT fit are true: how often the intervals hold the truth."""

import math

import numpy as np
from scipy.stats import t as student

from benchmarks.fopdt_cramer_rao import PARAMETERS, cramer_rao_bound
from benchmarks.section import Section, Target
from benchmarks.step_tests import StepTest, step_test
from identification.held_input import HeldInput
from identification.least_squares import fopdt_least_squares
from loop.signals import Real

SEEDS = 1_000
SAMPLES = 500
# Part of PV's whole change, and theta/tau; no theta falls on a sample.
NOISES = (0.005, 0.02)
RATIOS = (0.1037, 0.5137, 1.9137)
TAU, GAIN = 100.0, 2.0
COVERED = (0.93, 0.97)
EFFICIENT = (0.9, 1.15)


def one_test(seed: int, *, noise: float, ratio: float) -> StepTest:
    """Simulate one step test with its own noise.

    Parameters
    ----------
    seed : int
        Of the noise.
    noise : float
        Standard deviation as a part of the whole change of PV. [-]
    ratio : float
        theta/tau. [-]
    """
    rng = np.random.default_rng(seed)
    return step_test(SAMPLES, rng, K=GAIN, tau=TAU, theta=ratio * TAU, noise=noise)


def estimates(test: StepTest) -> tuple[Real, Real]:
    """Fit K, tau, theta with rest and drift free, and state their 95 % half-widths.

    Parameters
    ----------
    test : StepTest
        Data with truth.
    """
    held = HeldInput.from_samples(test.t, test.op)
    fit = fopdt_least_squares(test.t, test.pv, held, drift=True)
    half = float(student.ppf(0.975, fit.freedom)) * fit.standard_errors[:3]
    return np.array([fit.K, fit.tau, fit.theta]), half


def calibration(seeds: range, *, noise: float, ratio: float) -> tuple[Real, Real]:
    """Share of intervals that hold the truth, and mean square error over the Cramér-Rao bound.

    Parameters
    ----------
    seeds : range
        Noises, as they come.
    noise : float
        Standard deviation as a part of the whole change of PV. [-]
    ratio : float
        theta/tau. [-]

    Returns
    -------
    coverage, efficiency : ndarray, shape (3,)
        Of K, tau and theta. [-]
    """
    tests = [one_test(seed, noise=noise, ratio=ratio) for seed in seeds]
    found = [estimates(test) for test in tests]
    off = np.array([value for value, _ in found]) - [GAIN, TAU, ratio * TAU]
    half = np.array([width for _, width in found])
    efficiency = np.mean(off**2, axis=0) / cramer_rao_bound(tests[0])
    return np.mean(np.abs(off) <= half, axis=0), efficiency


def run() -> Section:
    """Fit a thousand noises of every case."""
    rows, coverages, ratios = [], [], []
    for noise in NOISES:
        for ratio in RATIOS:
            coverage, efficiency = calibration(range(SEEDS), noise=noise, ratio=ratio)
            coverages.append(coverage)
            ratios.append(efficiency)
            rows.append(
                (
                    f"{noise:.1%}",
                    f"{ratio:.4g}",
                    *(f"{share:.1%}" for share in coverage),
                    *(f"{value:.3f}" for value in efficiency),
                )
            )
    return Section(
        title="Calibration of the FOPDT fit's errors",
        how=(
            f"How often the stated 95 % intervals of {', '.join(PARAMETERS)} hold the truth, and "
            f"their mean square error over the Cramér-Rao bound, {SEEDS:,} noises (seeds 0 to "
            f"{SEEDS - 1}, none left out) a case, {SAMPLES} samples, rest and drift free, the dead "
            "time between two samples. Sampling error of a coverage: "
            f"{math.sqrt(0.95 * 0.05 / SEEDS):.1%}; of a "
            f"ratio: {math.sqrt(2 / SEEDS):.3f}."
        ),
        columns=(
            "noise",
            "theta/tau",
            *(f"{p} covered" for p in PARAMETERS),
            *(f"{p} MSE/bound" for p in PARAMETERS),
        ),
        rows=tuple(rows),
        targets=tuple(
            Target(what=what, limit=limit, reached=float(reached), unit="", at_least=at_least)
            for what, limit, reached, at_least in (
                ("smallest coverage", COVERED[0], np.min(coverages), True),
                ("largest coverage", COVERED[1], np.max(coverages), False),
                ("smallest MSE over bound", EFFICIENT[0], np.min(ratios), True),
                ("largest MSE over bound", EFFICIENT[1], np.max(ratios), False),
            )
        ),
    )
