"""The smallest variance that any unbiased estimate of K, tau and theta of a step test can have."""

import numpy as np

from benchmarks.step_tests import STEP, StepTest
from loop.signals import Real

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
