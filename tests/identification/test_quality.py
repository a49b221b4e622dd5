"""Measures of a fit against their definitions and against simulation."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.quality import Misfit, fit_percent, residual_colour, worst_misfit
from identification.spikes import find_spikes
from identification.verdict import Verdict, judge_misfit


def test_white_noise_is_white_as_often_as_the_test_promises() -> None:
    rng = np.random.default_rng(0)
    p = [residual_colour(rng.normal(size=400)).p_value for _ in range(300)]
    assert np.mean(np.array(p) < 0.1) == pytest.approx(0.1, abs=0.05)
    assert np.mean(np.array(p) < 0.5) == pytest.approx(0.5, abs=0.09)


def test_the_statistic_is_the_printed_sum() -> None:
    e = np.random.default_rng(1).normal(size=200)
    e -= e.mean()
    rho = [e[k:] @ e[: 200 - k] / (e @ e) for k in range(1, 21)]
    expected = 200 * 202 * sum(r**2 / (200 - k) for k, r in enumerate(rho, start=1))
    colour = residual_colour(e)
    assert colour.statistic == pytest.approx(expected)
    assert colour.lag1 == pytest.approx(rho[0])
    assert colour.lags == 20


@pytest.mark.parametrize("a", [0.5, 0.9])
def test_inflation_is_what_correlation_does_to_the_variance_of_a_mean(a: float) -> None:
    e = lfilter([1], [1, -a], np.random.default_rng(2).normal(size=200_000))
    assert residual_colour(e).inflation == pytest.approx((1 + a) / (1 - a), rel=0.1)
    means = e.reshape(500, 400).mean(axis=1)
    assert means.var() / (e.var() / 400) == pytest.approx((1 + a) / (1 - a), rel=0.2)
    assert not residual_colour(e).white


def test_nothing_to_correlate_is_white() -> None:
    for nothing in (np.zeros(50), np.array([1.0, 2.0, 3.0])):
        colour = residual_colour(nothing)
        assert colour.white
        assert colour.inflation == 1


def test_a_correlation_that_never_ends_is_summed_to_the_end() -> None:
    line = np.linspace(-1, 1, 12)
    assert residual_colour(line[:4]).inflation == 1
    half_wave = np.cos(np.linspace(0, 0.5, 400))
    assert residual_colour(half_wave - 0.9).inflation > 50


def test_fit_percent_is_100_for_the_data_and_0_for_their_mean() -> None:
    pv = np.array([1.0, 2.0, 4.0, 7.0])
    assert fit_percent(pv, np.zeros(4)) == 100
    assert fit_percent(pv, pv - pv.mean()) == pytest.approx(0)
    assert fit_percent(np.ones(4), np.zeros(4)) == 0
    weight = np.array([1.0, 1.0, 2.0, 1.0])
    repeated = np.repeat(pv, [1, 1, 2, 1])
    assert fit_percent(pv, 0.1 * pv, weight) == pytest.approx(fit_percent(repeated, 0.1 * repeated))


def test_the_worst_stretch_is_found_and_noise_is_not_called_misfit() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(1000.0)
    noise = rng.normal(0, 1, 1000)
    assert worst_misfit(t, noise, noise_sd=1, width=50).size < 0.1
    off = noise + 5 * ((t >= 400) & (t < 450))
    found = worst_misfit(t, off, noise_sd=1, width=50)
    assert (found.start, found.end) == (400, 449)
    assert found.size == pytest.approx(5 - 3 / 50**0.5, abs=0.4)


def test_averaged_values_count_for_their_readings() -> None:
    t = np.arange(10.0)
    residual = np.where(t < 5, 1.0, 0.0)
    found = worst_misfit(t, residual, noise_sd=1, width=5, weight=np.full(10, 180.0))
    assert found.size == pytest.approx(1 - 3 / 900**0.5)


def test_single_wild_readings_are_spikes_and_a_wrong_model_is_not() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.1, 300)
    wild = np.zeros(300)
    wild[[0, 50, 51, 52, 200, 299]] = 5
    assert np.flatnonzero(find_spikes(noise + wild, noise + wild)).tolist() == [
        0, 50, 51, 52, 200, 299,
    ]  # fmt: skip
    wrong = np.where(np.arange(300) > 100, 8.0, 0.0)
    assert not np.any(find_spikes(noise + wrong, noise + wrong))


def test_what_happens_often_or_lasts_is_no_spike() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.1, 300)
    often = noise + 5 * (rng.random(300) < 0.2)
    assert not np.any(find_spikes(often, often))
    lasting = noise.copy()
    lasting[100:105] += 5
    assert not np.any(find_spikes(lasting, lasting))


def test_short_records_and_readings_that_repeat_have_no_spikes_to_tell() -> None:
    assert not np.any(find_spikes(np.arange(20.0), np.arange(20.0)))
    assert not np.any(find_spikes(np.zeros(100), np.full(100, 7.0)))
    one_digit = np.zeros(100)
    one_digit[50] = 0.5
    assert not np.any(find_spikes(one_digit, 7 + one_digit))


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (0.0, "no error of the model stands out from the noise anywhere"),
        (0.01, "the model is off by no more than 0.1 % of the answer anywhere"),
    ],
)
def test_a_misfit_that_noise_hides_is_said_in_words_and_not_as_zero(size: float, said: str) -> None:
    found = judge_misfit(Misfit(size=size, start=100.0, end=200.0), swing=10.0, first_move=50.0)

    assert (found.verdict, found.reason) == (Verdict.TRUSTED, said)
