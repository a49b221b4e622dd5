"""Loops that share an oscillation, cascades, and which loop is not linear."""

import numpy as np
import pytest
from scipy.signal import lfilter

from loop.signals import Real
from monitoring.cascade_pairs import cascade_pairs
from monitoring.nonlinearity import nonlinearity
from monitoring.shared_oscillations import felt, shared_oscillations

N = 1500


def swing(rng: np.random.Generator, period: float, *, n: int = N) -> Real:
    """A linear loop that swings: a resonance driven by noise."""
    w, r = 2 * np.pi / period, 0.98
    noise = rng.normal(size=n + 500)
    return np.asarray(lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], noise))[500:]


def square(rng: np.random.Generator, period: float, *, n: int = N) -> Real:
    """What a sticking valve makes of a loop: a square wave whose half periods differ a little."""
    phase = np.cumsum((1 + 0.1 * rng.normal(size=n)) / period)
    return np.sign(np.sin(2 * np.pi * phase)) + 0.1 * rng.normal(size=n)


def lagged(signal: Real, tau: float, delay: int) -> Real:
    a = np.exp(-1 / tau)
    return np.roll(np.asarray(lfilter([1 - a], [1.0, -a], signal)), delay)


def test_loops_with_one_cause_are_grouped_and_others_are_not() -> None:
    rng = np.random.default_rng(1)
    cause = swing(rng, 40.0)
    errors = np.array(
        [
            cause + 0.2 * rng.normal(size=N),
            lagged(cause, 5.0, 3) + 0.05 * rng.normal(size=N),
            swing(rng, 40.0),  # the same period by chance
            -2.0 * lagged(cause, 12.0, 9),
            swing(rng, 23.0),
            rng.normal(size=N),
        ]
    )
    periods = np.array([40.0, 40.0, 40.0, 40.0, 23.0, np.nan])
    (group,) = shared_oscillations(errors, periods)

    assert group.members == (0, 1, 3)
    assert group.period == pytest.approx(40.0)
    assert 0.9 < group.similarity <= 1.0


def test_loops_that_keep_step_are_one_group_although_their_periods_are_read_differently() -> None:
    rng = np.random.default_rng(9)
    cause = square(rng, 40.0)
    errors = np.array([cause, lagged(cause, 6.0, 3), -lagged(cause, 15.0, 8), swing(rng, 40.0)])
    (group,) = shared_oscillations(errors, np.array([34.0, 40.0, 46.0, 40.0]))
    assert group.members == (0, 1, 2)
    assert group.period == 40.0


def test_swings_that_share_a_period_by_chance_are_seldom_one_group() -> None:
    """Of 60 pairs of resonances of one period: their spectra alone would group a dozen and more."""
    rng = np.random.default_rng(10)
    pairs = [np.array([swing(rng, 40.0), swing(rng, 40.0)]) for _ in range(60)]
    assert sum(len(shared_oscillations(pair, np.full(2, 40.0))) for pair in pairs) <= 1


def test_a_loop_feels_a_swing_that_noise_hides_and_no_other() -> None:
    rng = np.random.default_rng(11)
    cause = square(rng, 40.0)
    others = np.array([0.5 * lagged(cause, 5.0, 3) + rng.normal(size=N), rng.normal(size=N)])
    near, far = felt(cause, others, 40.0)
    assert 0.25 <= near < 1.0
    assert far == 0.0
    np.testing.assert_array_equal(felt(cause[:300], others[:, :300], 40.0), 0.0)


def test_gain_sign_offset_and_drift_of_a_loop_change_no_group() -> None:
    rng = np.random.default_rng(2)
    cause = swing(rng, 30.0)
    errors = np.array([cause, lagged(cause, 4.0, 2)])
    periods = np.full(2, 30.0)
    (plain,) = shared_oscillations(errors, periods)
    (changed,) = shared_oscillations(
        np.array([[-7.0], [0.01]]) * errors + 5.0 + 1e-3 * np.arange(N), periods
    )
    assert changed.members == plain.members
    # The trend is taken out by a straight line, which takes a little of the swing along.
    assert changed.similarity == pytest.approx(plain.similarity, abs=1e-6)


def test_a_loop_alone_or_with_too_few_cycles_makes_no_group() -> None:
    rng = np.random.default_rng(3)
    errors = np.array([swing(rng, 300.0)] * 2)
    assert shared_oscillations(errors, np.full(2, 300.0)) == ()
    assert shared_oscillations(errors, np.array([30.0, np.nan])) == ()
    assert shared_oscillations(np.ones((2, N)), np.full(2, 30.0)) == ()


def test_a_linear_loop_is_seldom_taken_for_a_nonlinear_one() -> None:
    rng = np.random.default_rng(4)
    found = [nonlinearity(swing(rng, 20.0, n=400), 20.0, seed=n).index for n in range(6)]
    assert all(index is not None for index in found)
    assert sum(index > 1 for index in found if index is not None) <= 1


def test_the_loop_where_the_squares_begin_is_the_most_nonlinear() -> None:
    rng = np.random.default_rng(5)
    valve = square(rng, 36.0, n=900)
    near, far = (lagged(lagged(valve, tau, 4), tau, 4) for tau in (2.0, 6.0))
    first, second, third = (
        nonlinearity(signal, 36.0).index for signal in (valve, near, far)
    )  # fmt: skip
    assert first is not None
    assert second is not None
    assert third is not None
    assert first > 1.0
    assert first > third


def test_the_index_does_not_depend_on_units_and_repeats_itself() -> None:
    signal = square(np.random.default_rng(6), 24.0, n=600)
    once, again = nonlinearity(signal, 24.0), nonlinearity(7.0 * signal - 3.0, 24.0)
    assert once.index == pytest.approx(again.index)


@pytest.mark.parametrize(
    ("signal", "period", "reason"),
    [
        (np.ones(600), 20.0, "the error does not move"),
        (np.arange(50.0), 20.0, "fewer than 10"),
        (np.arange(600.0), 2.0, "shorter than 4 samples"),
        (np.arange(600.0), np.nan, "shorter than 4 samples"),
    ],
)
def test_what_cannot_be_judged_says_why(signal: Real, period: float, reason: str) -> None:
    found = nonlinearity(signal, period)
    assert found.index is None
    assert reason in found.reason
    assert not found.significant


def test_an_output_that_is_another_loops_set_point_is_a_cascade() -> None:
    rng = np.random.default_rng(7)
    outer = np.cumsum(rng.normal(size=300))
    op = np.array([outer, np.cumsum(rng.normal(size=300)), np.zeros(300)])
    sp = np.array([np.full(300, 50.0), np.full(300, np.nan), 12.0 - 0.4 * outer])
    sp[2, 40:50] = np.nan
    (pair,) = cascade_pairs(op, sp)

    assert (pair.outer, pair.inner) == (0, 2)
    assert pair.explained == pytest.approx(1.0)


def test_slow_drifts_that_look_alike_and_few_moves_are_no_cascade() -> None:
    rng = np.random.default_rng(8)
    drift = np.linspace(0, 10, 300)
    op = np.array([drift + 0.1 * rng.normal(size=300), np.zeros(300)])
    sp = np.array([np.full(300, 1.0), drift + 0.1 * rng.normal(size=300)])
    assert cascade_pairs(op, sp) == ()

    steps = np.repeat([1.0, 2.0, 3.0], 100)
    assert cascade_pairs(np.array([steps, steps]), np.array([np.ones(300), steps])) == ()
