"""Least squares and ARX against scipy, the exact sampled process and Monte Carlo."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import lstsq

from loop.errors import PoorExcitation
from loop.open_loop import process_output
from loop.process import FOPDT
from loop.regression import Criterion, arx, choose_arx, lagged, least_squares, nested_residuals
from loop.signals import Real


def switching(n: int, seed: int, every: int = 15) -> Real:
    """An output that a careful hand moves now and then. [OP]"""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.choice([-1.0, 1.0], n // every + 1), every)[:n]


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 1000), k=st.integers(1, 6))
def test_the_fit_is_that_of_scipy(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    X, y = rng.normal(size=(40, k)), rng.normal(size=40)
    found = least_squares(X, y)
    b, rss = lstsq(X, y)[:2]
    np.testing.assert_allclose(found.coefficients, b, atol=1e-10)
    np.testing.assert_allclose(found.residuals, y - X @ b, atol=1e-10)
    assert found.noise_variance == pytest.approx(rss / (40 - k))
    covariance = rss / (40 - k) * np.linalg.inv(X.T @ X)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-8, atol=1e-12)
    scaled = np.linalg.cond(X / np.linalg.norm(X, axis=0))
    assert found.condition == pytest.approx(scaled, rel=1e-8)
    sums, rows = nested_residuals(X, y)
    assert rows == 40
    for j in range(1, k + 1):
        second = np.sum((y - X[:, :j] @ lstsq(X[:, :j], y)[0]) ** 2)
        assert sums[j - 1] == pytest.approx(second)


def test_the_criteria_are_the_printed_ones() -> None:
    X, y = np.random.default_rng(0).normal(size=(50, 2)), np.arange(50.0)
    fit = least_squares(X, y)
    rss = np.nansum(fit.residuals**2)
    assert fit.criterion(Criterion.AIC) == pytest.approx(50 * math.log(rss / 50) + 4)
    assert fit.criterion(Criterion.BIC) == pytest.approx(50 * math.log(rss / 50) + 2 * math.log(50))


def test_a_sampled_first_order_process_is_an_arx_model() -> None:
    """y[t] = a y[t-1] + K (1 - a) u[t-3] with a = e^(-h/tau): exact without noise."""
    op = switching(300, seed=1)
    t = np.arange(300.0)
    pv = process_output(FOPDT(K=2, tau=12, theta=2), t, op, op_before=0.0, pv0=40)
    model = arx(pv, op, na=1, nb=1, nk=3)
    a = math.exp(-1 / 12)
    assert model.a == pytest.approx([a])
    assert model.b == pytest.approx([2 * (1 - a)])
    assert model.constant == pytest.approx(40 * (1 - a))
    assert model.gain == pytest.approx(2)
    # A dead time between two samples spreads the input over two coefficients, the gain stays.
    pv = process_output(FOPDT(K=2, tau=12, theta=2.4), t, op, op_before=0.0, pv0=40)
    split = arx(pv, op, na=1, nb=2, nk=3)
    assert split.gain == pytest.approx(2)
    assert split.b == pytest.approx([2 * (1 - math.exp(-0.6 / 12)), 2 * (math.exp(-0.6 / 12) - a)])


def test_an_integrator_has_an_infinite_gain_with_its_sign() -> None:
    op = switching(100, seed=2)
    pv = np.concatenate([[0.0], -np.cumsum(op)[:-1]])
    model = arx(pv, op, na=0, nb=1)
    assert math.isfinite(model.gain)
    exact = arx(np.round(pv), op, na=1, nb=1)
    assert exact.gain < -1e6


def test_standard_errors_are_those_seen_over_many_records() -> None:
    rng = np.random.default_rng(4)
    found, claimed = [], []
    for seed in range(120):
        u = switching(150, seed=seed, every=5)
        y = np.zeros(150)
        e = rng.normal(0, 0.3, 150)
        for k in range(1, 150):
            y[k] = 0.8 * y[k - 1] + 0.5 * u[k - 1] + e[k]
        model = arx(y, u, na=1, nb=1)
        found.append([model.a[0], model.b[0]])
        claimed.append(model.fit.standard_errors[:2])
    spread = np.std(found, axis=0)
    np.testing.assert_allclose(np.mean(claimed, axis=0), spread, rtol=0.25)
    np.testing.assert_allclose(np.mean(found, axis=0), [0.8, 0.5], atol=0.02)


def test_a_gap_costs_exactly_the_rows_that_touch_it() -> None:
    op = switching(200, seed=3)
    pv = process_output(FOPDT(K=2, tau=12, theta=0), np.arange(200.0), op, op_before=0.0)
    holed = pv.copy()
    holed[100:103] = np.nan
    model = arx(holed, op, na=2, nb=1)
    assert model.fit.rows == 200 - 2 - 5
    np.testing.assert_array_equal(
        np.flatnonzero(np.isnan(model.fit.residuals)), [0, 1, *range(100, 105)]
    )
    assert model.gain == pytest.approx(2)


def test_the_delay_and_the_orders_are_found_among_candidates() -> None:
    op = switching(600, seed=5)
    t = np.arange(600.0)
    pv = process_output(FOPDT(K=2, tau=12, theta=4), t, op, op_before=0.0)
    e = np.zeros(600)
    for k, push in enumerate(np.random.default_rng(5).normal(0, 0.02, 600)):
        e[k] = math.exp(-1 / 12) * e[k - 1] + push if k else push
    for criterion in Criterion:
        model = choose_arx(pv + e, op, na=[1, 2], nb=[1, 2], nk=[1, 3, 5, 7], criterion=criterion)
        assert model.nk == 5
        assert model.fit.rows == 600 - 8  # every candidate on the same rows
    assert (model.a.size, model.b.size) == (1, 1)
    assert model.gain == pytest.approx(2, rel=0.05)


def test_a_candidate_that_cannot_be_fitted_does_not_stop_the_others() -> None:
    op = switching(300, seed=5)
    pv = process_output(FOPDT(K=2, tau=12, theta=0), np.arange(300.0), op, op_before=0.0)
    # Without noise y[t-1] - a y[t-2] is a multiple of u[t-2]: two of each are dependent.
    with pytest.raises(PoorExcitation, match="almost dependent"):
        arx(pv, op, na=2, nb=2)
    model = choose_arx(pv, op, na=[1, 2], nb=[1, 2], nk=[1])
    assert (model.a.size, model.b.size) != (2, 2)
    assert model.gain == pytest.approx(2)
    with pytest.raises(PoorExcitation, match="almost dependent"):
        choose_arx(pv, np.full(300, 5.0), na=[1], nb=[1], nk=[1, 2])


@pytest.mark.parametrize("stuck", [0.0, 41.37])
def test_an_output_that_does_not_move_is_refused_in_words(stuck: float) -> None:
    pv = np.random.default_rng(1).normal(size=100)
    with pytest.raises(PoorExcitation, match="hardly moves"):
        arx(pv, np.full(100, stuck), na=1, nb=1)


def test_too_few_rows_are_refused_in_words() -> None:
    with pytest.raises(PoorExcitation, match="4 rows without a gap cannot carry 3"):
        arx(np.arange(5.0), np.arange(5.0) ** 2, na=1, nb=1)


def test_lags_reach_before_the_record_as_gaps() -> None:
    np.testing.assert_array_equal(
        lagged(np.array([1.0, 2.0, 3.0]), [0, 1, 5]),
        [[1, np.nan, np.nan], [2, 1, np.nan], [3, 2, np.nan]],
    )


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"na": -1}, "na must be at least 0"),
        ({"nb": 0}, "nb must be at least 1"),
        ({"nk": -1}, "nk must be at least 0"),
        ({"y": [1.0, math.inf]}, "y must be one list"),
        ({"u": [[1.0]]}, "u must be one list"),
        ({"u": [1.0]}, "equally long"),
    ],
)
def test_impossible_orders_and_signals_are_refused(changed: dict[str, int], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        arx(**{"y": [1.0, 2.0], "u": [1.0, 2.0], "na": 1, "nb": 1, **changed})


def test_a_choice_needs_candidates() -> None:
    with pytest.raises(ValueError, match="at least one candidate"):
        choose_arx(np.arange(9.0), np.arange(9.0), na=[], nb=[1], nk=[1])
