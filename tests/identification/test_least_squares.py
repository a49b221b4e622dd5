"""Least squares of the simulation error: exact, at the statistical floor, by other routes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from identification.condense import condense
from identification.held_input import HeldInput, lag_response
from identification.least_squares import LeastSquaresFit, fopdt_least_squares
from loop.errors import PoorExcitation

K, TAU, THETA = 2.0, 120.0, 30.37


def step_at(instant: float, size: float = 10.0) -> HeldInput:
    return HeldInput(instants=np.array([instant]), levels=np.array([50.0, 50.0 + size]))


def record(
    t: np.ndarray,
    held: HeldInput,
    *,
    process: tuple[float, float, float] = (K, TAU, THETA),
    drift: float = 0.0,
    start: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    gain, tau, theta = process
    pv = 5 + gain * lag_response(held, t, tau, theta)[0] + drift * (t - t[0])
    pv += start * np.exp(-(t - t[0]) / tau)
    return np.asarray(pv + np.random.default_rng(seed).normal(0, noise, t.size))


def parameters(fit: LeastSquaresFit) -> tuple[float, ...]:
    return fit.K, fit.tau, fit.theta, fit.pv0, fit.drift, fit.start


STAIRS = HeldInput(
    instants=np.array([100.0, 350.0, 360.0, 700.0]), levels=np.array([50.0, 60.0, 52.0, 40.0, 49.0])
)


@pytest.mark.parametrize("n", [60, 900, 20_000])
@pytest.mark.parametrize("held", [step_at(100.0), STAIRS], ids=["one step", "four moves"])
def test_without_noise_every_parameter_is_recovered(n: int, held: HeldInput) -> None:
    t = np.linspace(0, 1200, n) + 7e5
    held = HeldInput(instants=held.instants + 7e5, levels=held.levels)
    pv = record(t, held, drift=2e-3)
    fit = fopdt_least_squares(t, pv, held, drift=True)
    assert parameters(fit) == pytest.approx((K, TAU, THETA, 5, 2e-3, 0), rel=1e-6)
    assert fit.noise_sd < 1e-6
    np.testing.assert_allclose(fit.predict(t), pv, atol=1e-5)


def test_an_unsteady_start_is_told_from_the_answer() -> None:
    t = np.linspace(0, 1200, 400)
    fit = fopdt_least_squares(t, record(t, STAIRS, start=-6.0), STAIRS, start=True)
    assert parameters(fit) == pytest.approx((K, TAU, THETA, 5, 0, -6), rel=1e-6)


def test_irregular_samples_lose_nothing() -> None:
    t = np.sort(np.random.default_rng(5).uniform(0, 1200, 300))
    fit = fopdt_least_squares(t, record(t, STAIRS), STAIRS)
    assert parameters(fit)[:4] == pytest.approx((K, TAU, THETA, 5), rel=1e-6)


def test_an_input_that_moves_all_the_time_is_fitted() -> None:
    rng = np.random.default_rng(2)
    t = np.arange(1500.0)
    held = HeldInput.from_samples(t, 50 + np.cumsum(rng.normal(size=t.size)))
    pv = record(t, held, process=(0.7, 40.0, 12.5), noise=0.5)
    fit = fopdt_least_squares(t, pv, held)
    assert np.all(
        np.abs([fit.K - 0.7, fit.tau - 40, fit.theta - 12.5]) < 4 * fit.standard_errors[:3]
    )


@pytest.mark.parametrize("drift", [False, True])
def test_estimate_and_errors_agree_with_scipy(drift: bool) -> None:
    t = np.linspace(0, 1000, 2001)
    pv = record(t, step_at(100.0), drift=1e-3 * drift, noise=0.4, seed=8)

    def model(t: np.ndarray, *p: float) -> np.ndarray:
        since = np.maximum(t - 100 - p[2], 0)
        return np.asarray(p[0] * 10 * (1 - np.exp(-since / p[1])) + p[3] + sum(p[4:]) * t)

    start = (1.5, 100.0, 20.0, 4.0, 0.0)[: 4 + drift]
    best, covariance = curve_fit(model, t, pv, start, xtol=1e-12, ftol=1e-12)
    fit = fopdt_least_squares(t, pv, step_at(100.0), drift=drift)

    errors = np.sqrt(np.diag(covariance))
    found = np.array(parameters(fit)[: 4 + drift])
    assert np.max(np.abs(found - best) / errors) < 0.02
    np.testing.assert_allclose(fit.standard_errors, errors, rtol=0.01)
    correlation = fit.covariance / np.outer(fit.standard_errors, fit.standard_errors)
    np.testing.assert_allclose(correlation, covariance / np.outer(errors, errors), atol=0.02)
    assert fit.sse == pytest.approx(np.sum((model(t, *best) - pv) ** 2), rel=1e-6)


@pytest.mark.parametrize(
    ("held", "drift", "start"),
    [
        pytest.param(step_at(100.0), False, False, id="one step"),
        pytest.param(step_at(100.0), True, False, id="one step with drift"),
        pytest.param(STAIRS, True, True, id="four moves with drift and unsteady start"),
    ],
)
def test_errors_reach_the_statistical_floor_and_intervals_hold(
    held: HeldInput, drift: bool, start: bool
) -> None:
    t = np.linspace(0, 1000, 400)
    z = []
    for seed in range(250):
        pv = record(t, held, drift=1e-3 * drift, start=2.0 * start, noise=0.3, seed=seed)
        fit = fopdt_least_squares(t, pv, held, drift=drift, start=start)
        error = np.array([fit.K - K, fit.tau - TAU, fit.theta - THETA])
        z.append(error / fit.standard_errors[:3])
    # Mean squared error over the Cramér-Rao bound, and coverage; both within what 250 seeds allow.
    np.testing.assert_allclose(np.mean(np.square(z), axis=0), 1, atol=0.3)
    np.testing.assert_allclose(np.mean(np.abs(z) < 1.96, axis=0), 0.95, atol=0.04)


@pytest.mark.parametrize("theta_over_tau", [0.02, 0.3, 3.0, 20.0])
@pytest.mark.parametrize("n", [150, 6000])
def test_no_seed_fails(theta_over_tau: float, n: int) -> None:
    tau = 300 / (1 + theta_over_tau)
    t = np.linspace(0, 1500, n)
    for seed in range(12):
        process = (-0.5, tau, tau * theta_over_tau)
        pv = record(t, step_at(150.0), process=process, noise=0.25, seed=seed)
        fit = fopdt_least_squares(t, pv, step_at(150.0), drift=True)
        error = np.array([fit.K, fit.tau, fit.theta]) - process
        assert np.all(np.abs(error) < 5 * fit.standard_errors[:3] + 0.02 * 1500 / n)


@settings(max_examples=25, deadline=None)
@given(
    speed=st.sampled_from([1 / 3600, 1 / 60, 1e-3, 77.0]),
    span=st.sampled_from([-0.01, 3.3, 1e4]),
    offset=st.sampled_from([-1e5, 273.15]),
    output=st.sampled_from([0.16, -50.0]),
)
def test_units_change_only_what_they_measure(
    speed: float, span: float, offset: float, output: float
) -> None:
    t = np.linspace(0, 1000, 500)
    pv = record(t, STAIRS, noise=0.3)
    fit = fopdt_least_squares(t, pv, STAIRS, drift=True)
    other_input = HeldInput(instants=STAIRS.instants * speed, levels=STAIRS.levels * output)
    other = fopdt_least_squares(t * speed, pv * span + offset, other_input, drift=True)
    factors = np.array([span / output, speed, speed, span, span / speed])
    np.testing.assert_allclose(other.K, fit.K * factors[0], rtol=1e-5)
    assert other.tau == pytest.approx(fit.tau * speed, rel=1e-5)
    assert other.theta == pytest.approx(fit.theta * speed, rel=1e-5)
    assert other.pv0 == pytest.approx(fit.pv0 * span + offset, rel=1e-6)
    np.testing.assert_allclose(
        other.standard_errors, fit.standard_errors * np.abs(factors), rtol=1e-3
    )


def test_weights_stand_for_repeated_readings() -> None:
    t = np.linspace(0, 1000, 200)
    pv = record(t, STAIRS, noise=0.3)
    weight = np.where(t < 500, 1.0, 3.0)
    weighted = fopdt_least_squares(t, pv, STAIRS, weight=weight)
    squares = weight * (weighted.predict(t) - pv) ** 2
    assert weighted.sse == pytest.approx(squares.sum())

    def model(t: np.ndarray, *p: float) -> np.ndarray:
        return np.asarray(p[3] + p[0] * lag_response(STAIRS, t, p[1], p[2])[0])

    best, _ = curve_fit(model, t, pv, (K, TAU, THETA, 5.0), sigma=weight**-0.5)
    found = np.array(parameters(weighted)[:4])
    assert np.max(np.abs(found - best) / weighted.standard_errors) < 0.02


def test_a_dead_time_that_noise_takes_below_nothing_stays_at_nothing() -> None:
    t = np.linspace(0, 500, 200)
    thetas = [
        fopdt_least_squares(
            t, record(t, step_at(50.0), process=(2, 60, 0), noise=2, seed=s), step_at(50.0)
        ).theta
        for s in range(12)
    ]
    assert min(thetas) == 0
    assert max(thetas) > 0


def test_an_answer_before_the_move_shows_as_a_negative_dead_time_where_allowed() -> None:
    t = np.linspace(0, 600, 300)
    pv = record(t, step_at(200.0), process=(2, 40, -60))
    fit = fopdt_least_squares(t, pv, step_at(200.0), earliest=-150.0)
    assert (fit.K, fit.tau, fit.theta) == pytest.approx((2, 40, -60), rel=1e-6)


def test_a_negative_dead_time_of_less_than_a_sample_is_searched_as_well() -> None:
    t = np.concatenate((np.arange(20) * 1e-3, 1 + np.arange(300.0)))
    pv = record(t, step_at(0.015), process=(2, 40, 10))
    fit = fopdt_least_squares(t, pv, step_at(0.015), earliest=-0.014)
    assert (fit.K, fit.tau, fit.theta) == pytest.approx((2, 40, 10), rel=1e-6)


@pytest.mark.parametrize(
    ("t", "pv", "held"),
    [
        ([0.0, 1.0], [0.0, 1.0], step_at(1.0)),
        (np.arange(50.0), np.arange(50.0), HeldInput(instants=np.array([]), levels=np.ones(1))),
        (np.arange(50.0), np.ones(50), step_at(10.0)),
        ([], [], step_at(10.0)),
    ],
)
def test_data_that_carry_no_model_are_refused(
    t: list[float], pv: list[float], held: HeldInput
) -> None:
    with pytest.raises(PoorExcitation, match="cannot carry 4 parameters"):
        fopdt_least_squares(np.array(t), np.array(pv), held)


def test_two_readings_behind_a_move_leave_a_fit_without_numbers_that_are_not_numbers() -> None:
    t = np.arange(20.0)
    fit = fopdt_least_squares(t, np.sin(t), step_at(19.0), drift=True, start=True)
    assert np.all(np.isfinite([*parameters(fit), *fit.standard_errors, fit.sse]))


@pytest.mark.parametrize(
    ("held", "process", "start"),
    [
        pytest.param(step_at(100.0), (K, TAU, THETA), 0.0, id="one step"),
        pytest.param(step_at(100.0), (K, 20.0, 200.0), 0.0, id="long dead time"),
        pytest.param(step_at(100.0), (K, 60.0, 10.0), 5.0, id="unsteady start"),
        pytest.param(STAIRS, (K, TAU, THETA), 3.0, id="four moves"),
        pytest.param(STAIRS, (K, 1.0, 0.3), 5.0, id="four moves of a fast process"),
    ],
)
def test_averages_of_a_long_record_give_what_all_samples_give(
    held: HeldInput, process: tuple[float, float, float], start: float
) -> None:
    t = np.linspace(0, 1000, 30_000)
    for seed in range(2):
        pv = record(t, held, process=process, drift=1e-3, start=start, noise=0.5, seed=seed)
        fitted = {"drift": True, "start": start > 0}
        averaged = fopdt_least_squares(t, pv, held, **fitted)
        every = fopdt_least_squares(t, pv, held, weight=np.ones(t.size), **fitted)
        found = np.array([parameters(averaged), parameters(every)])[:, : 5 + (start > 0)]
        assert np.max(np.abs(found[0] - found[1]) / every.standard_errors) < 0.2
        np.testing.assert_allclose(averaged.standard_errors, every.standard_errors, rtol=0.01)
        np.testing.assert_allclose(averaged.sse, np.sum((averaged.predict(t) - pv) ** 2), rtol=1e-2)


def test_buckets_keep_sums_and_start_anew_at_every_move() -> None:
    rng = np.random.default_rng(1)
    t, pv = np.arange(5000.0), rng.normal(size=5000)
    instants = np.array([1000.0, 3000.0])
    for at_most in (400, 50):
        used = condense(t, pv, instants, at_most=at_most)
        assert used.weight is not None
        assert used.weight.sum() == 5000
        assert used.t.size <= at_most
        assert used.pv @ used.weight == pytest.approx(pv.sum())
        again = condense(used.t, used.pv, instants, at_most=40, weight=used.weight)
        assert again.weight is not None
        assert again.pv @ again.weight == pytest.approx(pv.sum())
    fine = condense(t, pv, instants, at_most=400)
    assert {1000.0, 1001.0, 3000.0, 3001.0} <= set(fine.t.tolist())
    assert condense(t, pv, instants, at_most=5000).weight is None
    assert condense(t, pv, np.array([]), at_most=100).t.size <= 100


def test_a_move_at_the_very_last_sample_does_no_harm() -> None:
    t = np.arange(6000.0)
    moves = np.array([100.0, 2000.0, 5999.0])
    levels = np.array([0.0, 1.0, 0.0, 1.0])
    held = HeldInput(instants=moves, levels=levels)
    x, _, _ = lag_response(held, t, 50.0, 20.0)
    fit = fopdt_least_squares(t, 2 * x, held)
    assert fit.theta == pytest.approx(20.0, rel=1e-4)
    assert condense(t, x, moves, at_most=1000).weight is not None


@pytest.mark.parametrize(
    ("n", "spacing", "theta", "noise"), [(200, 1.0, 5.0, 0.05), (400, 2.0, 7.3, 0.0)]
)
def test_the_sum_of_squares_is_that_of_the_model_even_at_a_jump(
    n: int, spacing: float, theta: float, noise: float
) -> None:
    """A step from a singular matrix once ended the fit unseen, 0 s beside the sum of 5 s."""
    t = np.arange(n) * spacing
    held = step_at(n // 4 * spacing)
    pv = 20 + np.where(t >= held.instants[0] + theta, 20.0, 0.0)
    pv += np.random.default_rng(0).normal(0, noise, t.size)
    fit = fopdt_least_squares(t, pv, held)
    left = pv - fit.predict(t)
    assert fit.sse == pytest.approx(float(left @ left), rel=1e-6, abs=1e-9)
    assert theta - spacing < fit.theta < theta + spacing
