"""Smith's method against the model it comes from and against what is known of its errors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.two_point import LEVEL_28, LEVEL_63, TwoPoint, smith_two_point
from loop.errors import NotSteady, PoorExcitation


def answer(t: np.ndarray, tau: float, theta: float) -> np.ndarray:
    return np.where(t > theta, 1 - np.exp(-np.maximum(t - theta, 0) / tau), 0.0)


def of_unit_step(t: np.ndarray, pv: np.ndarray, *, to: float = 1.0) -> TwoPoint:
    return smith_two_point(t, pv, step_at=0.0, op_change=1.0, pv_from=0.0, pv_to=to)


def test_levels_and_constants_are_the_printed_ones() -> None:
    assert pytest.approx((0.28347, 0.63212), abs=5e-6) == (LEVEL_28, LEVEL_63)


@given(tau=st.floats(1, 100), theta=st.floats(0, 100), gain=st.sampled_from([-3.0, 0.2, 5.0]))
def test_a_first_order_answer_is_recovered(tau: float, theta: float, gain: float) -> None:
    t = np.linspace(0, theta + 12 * tau, 40_001)
    pv = 50 + gain * 4 * answer(t, tau, theta)
    found = smith_two_point(t + 7, pv, step_at=7, op_change=4, pv_from=50, pv_to=50 + gain * 4)
    assert found.process.K / gain == pytest.approx(1)
    assert found.process.tau == pytest.approx(tau, rel=1e-3)
    assert found.process.theta == pytest.approx(theta, abs=1e-3 * tau)


def test_two_equal_lags_give_the_known_error_of_the_method() -> None:
    # (1 + x) e^-x = 1 - level has the solutions x28 = 1.0523 and x63 = 2.1462.
    t = np.linspace(0, 40, 200_001)
    found = of_unit_step(t, 1 - (1 + t) * np.exp(-t))
    for passed, level in ((found.t28, LEVEL_28), (found.t63, LEVEL_63)):
        assert 1 - (1 + passed) * math.exp(-passed) == pytest.approx(level, abs=1e-6)
    fit = np.abs(answer(t, found.process.tau, found.process.theta) - (1 - (1 + t) * np.exp(-t)))
    assert fit.max() == pytest.approx(0.09, abs=0.005)


def test_noise_does_not_bring_the_passage_forward() -> None:
    rng = np.random.default_rng(3)
    t = np.linspace(0, 600, 6001)
    pv = answer(t, 60, 20) + rng.normal(0, 0.05, t.size)
    found = of_unit_step(t, pv).process
    assert found.tau == pytest.approx(60, abs=6)
    assert found.theta == pytest.approx(20, abs=4)


def test_a_process_without_dead_time_gets_none() -> None:
    t = np.linspace(0, 100, 101)
    assert of_unit_step(t, 1 - (np.exp(-t / 10)) ** 0.9).process.theta == pytest.approx(0, abs=0.2)
    # Faster at first than any lag with these points: theta would be negative.
    fast = np.interp(t, [0, 1, 20, 100], [0, 0.28347, 0.63212, 1])
    assert of_unit_step(t, fast).process.theta == 0


@pytest.mark.parametrize(
    ("pv", "to", "error", "words"),
    [
        ([0.0, 0.5, 1.0, 0.0], 0.0, PoorExcitation, "ends where it began"),
        ([0.0, 0.1, 0.2, 0.2], 1.0, PoorExcitation, "never passes 28.3%"),
        ([0.0, 0.4, 0.5, 0.5], 1.0, PoorExcitation, "never passes 63.2%"),
    ],
)
def test_an_answer_without_the_two_points_is_refused(
    pv: list[float], to: float, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        of_unit_step(np.arange(4.0), np.array(pv), to=to)


def test_an_answer_before_the_step_is_refused() -> None:
    t = np.arange(0.0, 100.0)
    with pytest.raises(NotSteady, match="no first-order answer"):
        smith_two_point(t, answer(t, 10, 5), step_at=50, op_change=1, pv_from=0, pv_to=1)


def test_the_dead_time_agrees_with_the_weights_of_the_two_times() -> None:
    # The reference writes theta = b t28 + (1 - b) t63 with b = 1.5.
    t = np.linspace(0, 40, 2001)
    found = of_unit_step(t, 1 - (1 + t) * np.exp(-t))
    assert found.process.theta == pytest.approx(1.5 * found.t28 - 0.5 * found.t63)
