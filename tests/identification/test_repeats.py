"""Repeats of one test are taken together, and what does not belong says why."""

from dataclasses import replace

import numpy as np
import pytest

from identification.held_input import HeldInput, lag_response
from identification.identify import Identification, identify
from identification.repeats import gain_over_level, pool
from identification.verdict import Verdict
from loop.errors import FitNotTrusted
from loop.process import FOPDT, IPDT
from loop.record import Record

T = np.arange(0.0, 500.0, 2.0)
DAY = 86_400.0


def bump(K: float = 2.0, tau: float = 50.0, *, seed: int = 0, op: tuple[float, float] = (40, 50),
            noise: float = 0.2) -> Identification:  # fmt: skip
    output = np.where(T < 100, *op)
    held = HeldInput.from_samples(T, output)
    pv = 20 + K * lag_response(held, T, tau, 11.3)[0]
    return identify(
        Record(t=T, pv=pv + np.random.default_rng(seed).normal(0, noise, T.size), op=output)
    )


def numbers(model: Identification) -> tuple[float, float, float]:
    assert isinstance(model.process, FOPDT)
    return model.process.K, model.process.tau, model.process.theta


def made_up(
    K: float, tau: float, theta: float, errors: tuple[float, float, float]
) -> Identification:
    """A test with known results, as the pooling sees it."""
    return replace(GOOD, process=FOPDT(K=K, tau=tau, theta=theta), standard_errors=np.array(errors))


GOOD = bump()


def test_equal_tests_pool_to_the_weighted_mean_with_a_smaller_error() -> None:
    models = [bump(seed=seed) for seed in range(5)]
    found = pool(models)
    assert found.used == (0, 1, 2, 3, 4)
    assert found.left_out == ()
    assert pytest.approx(np.mean([numbers(m)[0] for m in models]), rel=2e-3) == found.process.K
    single = np.mean([m.standard_errors for m in models], axis=0)
    # Five tests that agree know it better by about the root of five.
    np.testing.assert_array_less(found.standard_errors, 0.8 * single)
    truth = np.array([2, 50, 11.3])
    pooled = np.array([found.process.K, found.process.tau, found.process.theta])
    assert np.all(np.abs(pooled - truth) < 4 * found.standard_errors)
    assert found.notes[0] == "5 of 5 tests count"


def test_the_spread_between_tests_is_found_and_widens_the_error() -> None:
    rng = np.random.default_rng(1)
    models = [
        made_up(
            2 + rng.normal(0, 0.15), 50 + rng.normal(0, 4), 11 + rng.normal(0, 1), (0.02, 1, 0.3)
        )
        for _ in range(60)
    ]
    found = pool(models)
    np.testing.assert_allclose(found.spread, [0.15, 4, 1], rtol=0.25)
    np.testing.assert_allclose(found.standard_errors, np.array([0.15, 4, 1]) / 60**0.5, rtol=0.25)


def test_a_refused_test_and_another_kind_of_process_are_left_out_with_the_reason() -> None:
    refused = replace(GOOD, process=None, verdict=Verdict.REFUSED, reasons=("PV hardly follows.",))
    tank = replace(GOOD, process=IPDT(K=0.1, theta=5.0), kind="IPDT")
    found = pool([GOOD, refused, tank, bump(seed=2)])
    assert found.used == (0, 3)
    assert [(test.index, test.reason) for test in found.left_out] == [
        (1, "PV hardly follows."),
        (2, "Its model is IPDT, not first order."),
    ]


def test_an_outlier_is_thrown_out_and_a_wrong_unit_is_named() -> None:
    models = [bump(seed=seed) for seed in range(4)]
    K, tau, theta = numbers(GOOD)
    fahrenheit = made_up(1.8 * K, tau, theta, (0.02, 1, 0.3))
    slow = made_up(K, 2 * tau, theta, (0.02, 1, 0.3))
    found = pool([*models, fahrenheit, slow])
    assert found.used == (0, 1, 2, 3)
    assert [test.index for test in found.left_out] == [4, 5]
    assert "Fahrenheit to Celsius" in found.left_out[0].reason
    assert "Fahrenheit" not in found.left_out[1].reason
    assert pytest.approx(2, rel=0.01) == found.process.K


def test_two_tests_that_differ_are_kept_with_the_spread_they_show() -> None:
    found = pool([made_up(2, 50, 10, (0.02, 1, 0.3)), made_up(3, 50, 10, (0.02, 1, 0.3))])
    assert found.used == (0, 1)
    assert pytest.approx(2.5) == found.process.K
    assert found.spread[0] == pytest.approx(2**-0.5, rel=0.01)


def test_one_test_is_no_repeat() -> None:
    with pytest.raises(FitNotTrusted, match="two tests with a first-order model, and 1 is left"):
        pool([GOOD, replace(GOOD, process=None, verdict=Verdict.REFUSED, reasons=("No.",))])
    with pytest.raises(ValueError, match="2 tests need as many times, got 1"):
        pool([GOOD, GOOD], times=[0.0])


def test_a_gain_that_falls_over_months_is_a_drift_and_chance_is_none() -> None:
    rng = np.random.default_rng(0)
    months = [30 * DAY * k for k in range(8)]
    falling = [
        made_up(2 - 0.05 * k + rng.normal(0, 0.01), 50, 11, (0.02, 1, 0.3)) for k in range(8)
    ]
    found = pool(falling, times=months)
    assert found.trends is not None
    assert found.trends[0] == pytest.approx(-0.05 / (30 * DAY), rel=0.1)
    assert found.trends[1:] == pytest.approx([0, 0])
    assert "K drifts: -19 % over 210 days" in " ".join(found.notes)
    steady = [made_up(2 + rng.normal(0, 0.05), 50, 11, (0.02, 1, 0.3)) for _ in range(8)]
    assert pool(steady, times=months).trends is None
    assert pool(steady, times=[0.0] * 8).trends is None


def test_a_gain_that_depends_on_the_level_is_not_linear() -> None:
    tests = [
        bump(K=2 - 0.02 * (to - 40), op=(40, to), seed=int(to)) for to in (45.0, 50.0, 60.0, 65.0)
    ]
    found = gain_over_level(tests)
    assert found.certain
    assert found.slope == pytest.approx(-0.04, rel=0.1)  # the mean level moves half as far
    assert "the process is not linear" in found.sentence
    same = gain_over_level([bump(op=(40, to), seed=int(to)) for to in (45.0, 50.0, 60.0)])
    assert not same.certain
    assert "chance may explain" in same.sentence
    with pytest.raises(FitNotTrusted, match="takes three tests at different levels"):
        gain_over_level(tests[:2])
