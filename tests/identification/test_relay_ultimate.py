"""Exact ultimate point of a model, and its errors against draws."""

import numpy as np
import pytest

from identification.relay_ultimate import fitted_ultimate
from loop.controller import PID, Action
from loop.margins import margins
from loop.process import FOPDT


def test_the_gain_margin_of_that_gain_is_one() -> None:
    process = FOPDT(K=-1.6, tau=9.0, theta=4.0)
    found = fitted_ultimate(process, np.zeros((3, 3)))
    assert found is not None
    assert found.Ku_error == found.Pu_error == 0
    half = PID(Kc=found.Ku / 2, action=Action.DIRECT)
    assert margins(process, half).gain == pytest.approx(2.0, rel=1e-9)


def test_errors_are_those_of_draws() -> None:
    at = np.array([2.0, 120.0, 10.0])
    # K and tau nearly in proportion, as a short test leaves them.
    factors = np.array([[0.04, 0.0396, 0.0], [0.0396, 0.04, 0.0], [0.0, 0.0, 0.0004]])
    covariance = factors / 100 * np.outer(at, at)
    found = fitted_ultimate(FOPDT(K=2.0, tau=120.0, theta=10.0), covariance)
    assert found is not None
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(at, covariance, 2000)
    points = [
        fitted_ultimate(FOPDT(K=k, tau=tau, theta=theta), np.zeros((3, 3)))
        for k, tau, theta in drawn.tolist()
    ]
    Ku = np.array([p.Ku for p in points if p is not None])
    Pu = np.array([p.Pu for p in points if p is not None])
    assert found.Ku_error == pytest.approx(Ku.std(), rel=0.08)
    assert found.Pu_error == pytest.approx(Pu.std(), rel=0.08)
    assert found.Ku_error / found.Ku < 0.006  # though K alone is off by 2 %


def test_without_dead_time_there_is_none() -> None:
    assert fitted_ultimate(FOPDT(K=1.0, tau=1.0, theta=0.0), np.zeros((3, 3))) is None
