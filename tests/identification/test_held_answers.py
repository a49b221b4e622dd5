"""Answers to a held output against scipy's simulation of the same transfer function."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lsim

from identification.held_answers import (
    double_integral_answer,
    integral_answer,
    second_order_answer,
)
from identification.held_input import HeldInput, lag_response

T = np.linspace(0, 100, 401)
HELD = HeldInput(instants=np.array([5.0, 12, 13.25, 50]), levels=np.array([1.0, 4, 2, 7, 0]))
NO_MOVE = HeldInput(instants=np.array([]), levels=np.array([3.0]))


def simulated(numerator: list[float], denominator: list[float], theta: float) -> np.ndarray:
    fine = np.linspace(0, 100, 1601)  # every move lies on it
    u = (HELD.levels - HELD.levels[0])[np.searchsorted(HELD.instants + theta, fine, side="right")]
    return np.asarray(lsim((numerator, denominator), u, fine, interp=False)[1][::4])


@pytest.mark.parametrize("q", [1e-3, 0.1, 0.24, 0.25, 0.2501, 1.0, 8.0])
@pytest.mark.parametrize("theta", [0.0, 2.5])
def test_second_order_agrees_with_a_simulation(q: float, theta: float) -> None:
    y, slope = second_order_answer(HELD, T, 8.0, q, theta)
    np.testing.assert_allclose(y, simulated([1], [64 * q, 8, 1], theta), atol=2e-7)
    np.testing.assert_allclose(slope, simulated([1, 0], [64 * q, 8, 1], theta), atol=2e-7)


def test_a_vanishing_second_lag_leaves_the_first() -> None:
    y, _ = second_order_answer(HELD, T, 8.0, 1e-9, 2.0)
    np.testing.assert_allclose(y, lag_response(HELD, T, 8.0, 2.0)[0], atol=1e-6)


def test_integrals_agree_with_a_simulation() -> None:
    once, twice = simulated([1], [1, 0], 2.5), simulated([1], [1, 0, 0], 2.5)
    np.testing.assert_allclose(integral_answer(HELD, T, 2.5), once, atol=1e-9)
    np.testing.assert_allclose(double_integral_answer(HELD, T, 2.5), twice, atol=1e-7)


def test_an_output_that_stands_still_has_no_answer() -> None:
    assert not second_order_answer(NO_MOVE, T, 8.0, 0.2, 1.0)[0].any()
    assert not integral_answer(NO_MOVE, T, 1.0).any()
    assert not double_integral_answer(NO_MOVE, T, 1.0).any()


@settings(max_examples=40, deadline=None)
@given(a1=st.floats(1e-4, 1e6), q=st.floats(1e-6, 1e3), theta=st.floats(0, 200))
def test_answers_are_finite_whatever_the_shape(a1: float, q: float, theta: float) -> None:
    for values in second_order_answer(HELD, T, a1, q, theta):
        assert np.all(np.isfinite(values))
