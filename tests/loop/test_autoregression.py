"""Autoregressions against known processes, scipy and each other."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from loop.autoregression import AR, ar_least_squares, ar_order, autocovariance, burg, yule_walker
from loop.errors import PoorExcitation
from loop.regression import Criterion
from loop.signals import Real

KNOWN = np.array([1.2, -0.6])
METHODS = pytest.mark.parametrize("method", [ar_least_squares, yule_walker, burg])


def known_process(n: int, seed: int = 1, mean: float = 50.0) -> Real:
    e = np.random.default_rng(seed).normal(0, 0.5, n + 200)
    return np.asarray(mean + lfilter([1.0], [1.0, *-KNOWN], e)[200:])


@METHODS
def test_a_known_process_is_found(method: Callable[[Real, int], AR]) -> None:
    y = known_process(5000)
    model = method(y, 2)
    np.testing.assert_allclose(model.a, KNOWN, atol=4 * model.standard_errors.max())
    assert model.noise_variance == pytest.approx(0.25, rel=0.05)
    assert model.constant / (1 - model.a.sum()) == pytest.approx(50, abs=0.1)
    assert model.delay == 1
    predicted = model.constant + model.a[0] * y[1:-1] + model.a[1] * y[:-2]
    np.testing.assert_allclose(model.residuals[2:], y[2:] - predicted, atol=1e-9)
    assert np.all(np.isnan(model.residuals[:2]))


@METHODS
def test_standard_errors_are_those_seen_over_many_records(
    method: Callable[[Real, int], AR],
) -> None:
    models = [method(known_process(300, seed=seed), 2) for seed in range(120)]
    spread = np.std([model.a for model in models], axis=0)
    claimed = np.mean([model.standard_errors for model in models], axis=0)
    np.testing.assert_allclose(claimed, spread, rtol=0.25)
    # Theory: both are sqrt((1 - a2^2)/n).
    np.testing.assert_allclose(claimed, math.sqrt((1 - 0.36) / 300), rtol=0.05)


def test_the_autocovariance_is_the_sum_of_products() -> None:
    y = known_process(200)
    z = y - y.mean()
    second = [z[k:] @ z[: 200 - k] / 200 for k in range(11)]
    np.testing.assert_allclose(autocovariance(y, 10), second, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(
        yule_walker(y, 4).a, solve_toeplitz(second[:4], second[1:5]), rtol=1e-9
    )


def test_the_autocovariance_takes_known_pairs_only() -> None:
    y = known_process(400)
    y[50:60] = np.nan
    y[::7] = np.nan
    z = y - np.nanmean(y)
    second = [np.nanmean(z[k:] * z[: 400 - k]) * (1 - k / 400) for k in range(6)]
    np.testing.assert_allclose(autocovariance(y, 5), second, rtol=1e-9)


def test_gaps_do_not_move_the_answer() -> None:
    y = known_process(20_000)
    y[np.random.default_rng(9).random(y.size) < 0.2] = np.nan
    np.testing.assert_allclose(ar_least_squares(y, 2).a, KNOWN, atol=0.03)
    np.testing.assert_allclose(yule_walker(y, 2).a, KNOWN, atol=0.03)


def test_burg_sees_a_sine_where_the_autocovariance_is_too_short() -> None:
    """A pure sine obeys y[t] = 2 cos(w) y[t-1] - y[t-2]."""
    y = np.sin(0.7 * np.arange(30))
    error = {method: abs(method(y, 2).a[0] - 2 * math.cos(0.7)) for method in (burg, yule_walker)}
    assert error[burg] < 0.05
    assert error[yule_walker] > 2 * error[burg]


def test_burg_of_a_decay_is_exact_after_one_step() -> None:
    y = np.array([1.0, -1.0] * 20)
    model = burg(y, 3)
    assert model.a == pytest.approx([-1, 0, 0])


@pytest.mark.parametrize("criterion", Criterion)
def test_the_order_is_found(criterion: Criterion) -> None:
    found = ar_order(known_process(3000, seed=3), 12, criterion=criterion)
    assert found == 2 if criterion is Criterion.BIC else found >= 2
    noise = np.random.default_rng(2).normal(size=3000)
    assert ar_order(noise, 12, criterion=Criterion.BIC) == 0


def test_the_order_is_judged_as_by_separate_fits() -> None:
    y = known_process(500, seed=8)
    values = []
    for order in range(1, 6):
        # The same rows for every order: those that the largest can use.
        residuals = ar_least_squares(y[5 - order :], order).residuals[order:]
        n = residuals.size
        assert n == 495
        values.append(n * math.log(np.sum(residuals**2) / n) + 2 * (order + 1))
    assert ar_order(y, 5, criterion=Criterion.AIC) == 1 + int(np.argmin(values))


def test_a_delay_leaves_what_feedback_cannot_reach() -> None:
    """y = e + .7 e[t-1] + ...: predicted 3 ahead, an AR(1) of pole .7 keeps 1 + .7^2 + .7^4."""
    y = lfilter([1.0], [1.0, -0.7], np.random.default_rng(6).normal(size=40_000))
    model = ar_least_squares(np.asarray(y), 5, delay=3)
    assert model.noise_variance == pytest.approx(1 + 0.7**2 + 0.7**4, rel=0.03)
    assert model.a[0] == pytest.approx(0.7**3, abs=0.03)
    assert model.delay == 3


@METHODS
@pytest.mark.parametrize("y", [np.full(50, 3.0), np.zeros(50)])
def test_a_signal_that_does_not_move_is_refused(method: Callable[[Real, int], AR], y: Real) -> None:
    with pytest.raises(PoorExcitation, match="move"):
        method(y, 2)


@pytest.mark.parametrize(
    ("fit", "words"),
    [
        (lambda: burg(np.array([1.0, np.nan, 3, 4, 5, 6, 7, 8]), 1), "without gaps"),
        (lambda: burg(np.arange(5.0), 2), "5 samples are too few"),
        (lambda: ar_least_squares(np.arange(5.0), 3), "cannot carry 4"),
        (lambda: ar_order(np.arange(9.0), 8), "cannot carry 9"),
        (lambda: yule_walker(np.array([1.0, np.nan, 2.0, np.nan]), 1), "no pair at lag 1"),
        (lambda: yule_walker(np.full(9, np.nan), 1), "no pair at lag 0"),
        (lambda: yule_walker(np.array([1.0, 2.0]), 3), "no pair at lag 2"),
        (lambda: yule_walker(np.array([1.0, 2.0, 1.5]), 2), "cannot carry 2"),
    ],
)
def test_too_little_data_is_refused_in_words(fit: Callable[[], object], words: str) -> None:
    with pytest.raises(PoorExcitation, match=words):
        fit()


def test_gaps_that_leave_an_impossible_autocovariance_are_refused() -> None:
    """Neighbours are large together, lonely samples small: r[1] > r[0], which no process has."""
    y = np.array([10, 10, np.nan, -10, -10, *([np.nan, 0.0] * 8)])
    with pytest.raises(PoorExcitation, match="no process has"):
        yule_walker(y, 1)


@pytest.mark.parametrize(
    "fit",
    [
        lambda: ar_least_squares(np.arange(9.0), 0),
        lambda: ar_least_squares(np.arange(9.0), 1, delay=0),
        lambda: yule_walker(np.arange(9.0), 0),
        lambda: burg(np.arange(9.0), 0),
        lambda: ar_order(np.arange(9.0), 0),
    ],
)
def test_orders_below_one_are_refused(fit: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match="must be at least 1, got 0"):
        fit()
