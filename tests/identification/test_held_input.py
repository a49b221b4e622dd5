"""The exact answer of a lag to a held input, against other routes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from identification.held_input import HeldInput, lag_response

STAIRS = HeldInput(instants=np.array([3.0, 5.5, 11.0]), levels=np.array([2.0, 4.0, 1.0, 1.5]))


def test_one_step_gives_the_textbook_exponential() -> None:
    held = HeldInput(instants=np.array([10.0]), levels=np.array([0.0, 2.0]))
    t = np.linspace(0, 100, 301)
    x = lag_response(held, t, tau=12.0, theta=3.3)[0]
    expected = np.where(t > 13.3, 2 * (1 - np.exp(-(t - 13.3) / 12)), 0)
    np.testing.assert_allclose(x, expected, atol=1e-13)


def test_several_moves_agree_with_an_integrator_of_the_differential_equation() -> None:
    tau, theta = 2.5, 0.8

    def slope(at: float, x: np.ndarray) -> np.ndarray:
        level = STAIRS.levels[np.searchsorted(STAIRS.instants, at - theta, side="right")]
        return np.asarray((level - 2.0 - x) / tau)

    t = np.linspace(0, 20, 41)
    solved = solve_ivp(slope, (0, 20), [0.0], t_eval=t, max_step=0.01, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(lag_response(STAIRS, t, tau, theta)[0], solved.y[0], atol=1e-4)


def test_an_input_that_moves_at_every_sample_agrees_with_a_recursive_filter() -> None:
    rng = np.random.default_rng(0)
    u = rng.normal(size=400)
    t, tau = np.arange(400.0), 7.0
    a = np.exp(-1 / tau)
    filtered = lfilter([0, 1 - a], [1, -a], u - u[0])
    x = lag_response(HeldInput.from_samples(t, u), t, tau, theta=0.0)[0]
    np.testing.assert_allclose(x, filtered, atol=1e-12)


@pytest.mark.parametrize(
    ("stretch", "theta"),
    [((0, 20), 0.8), ((0, 2), 0.8), ((12, 20), 0.1), ((0, 2000), 0.8), ((4, 9), -1.5)],
)
def test_derivatives_agree_with_differences(stretch: tuple[float, float], theta: float) -> None:
    t = np.linspace(*stretch, 57) + 0.0123
    tau, step = 2.5, 1e-6
    _, d_tau, d_theta = lag_response(STAIRS, t, tau, theta)
    slower, faster = (lag_response(STAIRS, t, tau + s, theta)[0] for s in (step, -step))
    later, earlier = (lag_response(STAIRS, t, tau, theta + s)[0] for s in (step, -step))
    np.testing.assert_allclose(d_tau, (slower - faster) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(d_theta, (later - earlier) / (2 * step), atol=1e-7)


@given(cut=st.integers(min_value=1, max_value=199), theta=st.floats(0, 30))
def test_a_stretch_answers_as_it_does_within_the_whole(cut: int, theta: float) -> None:
    t = np.linspace(0, 40, 200)
    whole = lag_response(STAIRS, t, 2.5, theta)
    parts = [lag_response(STAIRS, part, 2.5, theta) for part in (t[:cut], t[cut:])]
    np.testing.assert_allclose(np.concatenate(parts, axis=1), whole, atol=1e-14)


def test_far_behind_a_move_the_lag_has_arrived() -> None:
    t = np.array([1e6, 2e6])
    np.testing.assert_array_equal(lag_response(STAIRS, t, 2.5, 0.0)[0], [-0.5, -0.5])


def test_a_stated_output_before_the_first_sample_moves_at_the_first_sample() -> None:
    held = HeldInput.from_samples(np.array([5.0, 6.0]), np.array([30.0, 30.0]), op_before=10.0)
    assert (held.instants.tolist(), held.levels.tolist()) == ([5.0], [10.0, 30.0])
    same = HeldInput.from_samples(np.array([5.0, 6.0]), np.array([30.0, 30.0]), op_before=30.0)
    assert same.moves == 0


def test_a_noisy_output_is_averaged_over_its_holds() -> None:
    t, op = np.arange(6.0), np.array([1.0, 3.0, 2.0, 10.0, 12.0, 11.0])
    held = HeldInput.from_holds(t, op, np.array([3]))
    assert (held.instants.tolist(), held.levels.tolist()) == ([3.0], [2.0, 11.0])
    before = HeldInput.from_holds(t, op, np.array([0, 3]), op_before=0.0)
    assert (before.instants.tolist(), before.levels.tolist()) == ([0.0, 3.0], [0.0, 2.0, 11.0])


@pytest.mark.parametrize(
    ("instants", "levels", "words"),
    [([1.0], [1.0], "1 moves need 2 levels, got 1"), ([1.0, 1.0], [1.0, 2.0, 3.0], "in time")],
)
def test_an_input_that_cannot_be_is_refused(
    instants: list[float], levels: list[float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        HeldInput(instants=np.array(instants), levels=np.array(levels))
