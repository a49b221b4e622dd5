"""The stated errors of the FOPDT fit are true: a small part of the benchmark."""

import numpy as np
import pytest

from benchmarks.fopdt_calibration import calibration, one_test
from benchmarks.fopdt_cramer_rao import cramer_rao_bound
from benchmarks.step_tests import answer

SEEDS = 120


@pytest.mark.parametrize("ratio", [0.1037, 0.5137])
def test_intervals_hold_and_nothing_is_wasted(ratio: float) -> None:
    coverage, efficiency = calibration(range(SEEDS), noise=0.02, ratio=ratio)
    # Four sampling errors either way: 2 % of a coverage, 0.13 of a ratio.
    np.testing.assert_allclose(coverage, 0.95, atol=0.08)
    np.testing.assert_allclose(efficiency, 1.0, atol=0.5)


def test_the_dead_time_falls_between_two_samples() -> None:
    test = one_test(0, noise=0.02, ratio=0.5137)
    spacing = test.t[1] - test.t[0]
    part = (test.theta / spacing) % 1
    assert 0.05 < part < 0.95


def test_the_bound_agrees_with_derivatives_by_differences() -> None:
    test = one_test(0, noise=0.02, ratio=0.5137)
    point = np.array([test.K, test.tau, test.theta, 50.0, 0.0])
    columns = []
    for i, step in enumerate([1e-6, 1e-4, 1e-4, 1e-6, 1e-9]):
        up, down = point.copy(), point.copy()
        up[i] += step
        down[i] -= step
        columns.append(
            (answer(test.t, *up, at=test.at) - answer(test.t, *down, at=test.at)) / (2 * step)
        )
    J = np.column_stack(columns)
    bound = np.diag(np.linalg.inv(J.T @ J))[:3] * test.noise**2
    np.testing.assert_allclose(cramer_rao_bound(test), bound, rtol=1e-3)
