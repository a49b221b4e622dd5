"""Draws of the parameters scatter as repeated tests of the same process do."""

from dataclasses import replace

import numpy as np
import pytest

from identification.draws import parameter_draws
from identification.held_answers import integral_answer, second_order_answer
from identification.held_input import HeldInput, lag_response
from identification.identify import Identification, identify
from loop.process import FOPDT, IPDT
from loop.record import Record

T = np.arange(0.0, 500.0, 2.0)
OP = np.where(T < 150, 40.0, 50.0)
HELD = HeldInput.from_samples(T, OP)


def found(
    *, gain: float = 2.0, theta: float = 11.3, noise: float = 0.4, seed: int = 1
) -> Identification:
    pv = 60 + gain * lag_response(HELD, T, 50.0, theta)[0]
    pv = pv + np.random.default_rng(seed).normal(0, noise, T.size)
    return identify(Record(t=T, pv=pv, op=OP))


def estimates(model: Identification) -> list[float]:
    assert isinstance(model.fitted, FOPDT)
    return [model.fitted.K, model.fitted.tau, model.fitted.theta]


def test_draws_scatter_and_move_together_as_repeated_tests_do() -> None:
    models = [found(gain=-2.0, seed=seed) for seed in range(60)]
    repeats = np.array([estimates(model) for model in models])
    # Draws about each of them, so that no single noise decides.
    draws = np.concatenate([parameter_draws(m, n=50, seed=i) for i, m in enumerate(models)])
    off = draws - np.repeat(repeats, 50, axis=0)
    # The scatter of 60 repeats is itself known to 9 %, a correlation to 0.1.
    np.testing.assert_allclose(off.std(axis=0), repeats.std(axis=0), rtol=0.25)
    np.testing.assert_allclose(np.corrcoef(off.T), np.corrcoef(repeats.T), atol=0.25)


def test_draws_lie_about_the_fit_and_repeat_with_the_seed() -> None:
    model = found()
    draws = parameter_draws(model, n=2000, seed=4)
    assert draws.shape == (2000, 3)
    np.testing.assert_allclose(np.median(draws, axis=0), estimates(model), rtol=0.02)
    np.testing.assert_array_equal(draws, parameter_draws(model, n=2000, seed=4))
    assert not np.array_equal(draws, parameter_draws(model, n=2000, seed=5))


def test_no_draw_changes_the_sign_of_the_gain_or_precedes_the_output() -> None:
    draws = parameter_draws(found(gain=-0.3, theta=0.0, noise=1.5), n=2000)
    assert np.all(draws[:, 0] < 0)
    assert np.all(draws[:, 1] > 0)
    assert draws[:, 2].min() == 0


def test_without_a_model_there_is_nothing_to_draw_from() -> None:
    refused = identify(Record(t=T, pv=np.full(T.size, 3.0), op=OP))
    with pytest.raises(ValueError, match="need a fitted model"):
        parameter_draws(refused)
    with pytest.raises(ValueError, match="at least 1, got 0"):
        parameter_draws(replace(found()), n=0)


def test_an_integrator_has_draws_of_its_slope_and_dead_time() -> None:
    pv = 60 + 0.02 * integral_answer(HELD, T, 11.3)
    pv = pv + np.random.default_rng(1).normal(0, 0.4, T.size)
    model = identify(Record(t=T, pv=pv, op=OP))
    assert isinstance(model.process, IPDT)
    draws = parameter_draws(model, n=3000)
    assert draws.shape == (3000, 2)
    assert model.standard_errors is not None
    np.testing.assert_allclose(draws.std(axis=0), model.standard_errors, rtol=0.1)


def test_a_simplified_process_has_no_errors_to_draw_from() -> None:
    y, slope = second_order_answer(HELD, T, 60.0, 0.2, 11.3)
    pv = 60 + 2 * (y - 30 * slope) + np.random.default_rng(1).normal(0, 0.1, T.size)
    model = identify(Record(t=T, pv=pv, op=OP))
    with pytest.raises(ValueError, match="speaks for two lags and a lead"):
        parameter_draws(model)
