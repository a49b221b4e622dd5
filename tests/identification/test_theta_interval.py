"""Intervals of the dead time by profile and bootstrap: like parabolas where those hold."""

import numpy as np
import pytest

from identification.held_input import HeldInput, lag_response
from identification.identify import Identification, identify
from identification.theta_interval import bootstrap_intervals, profile_interval
from loop.errors import FitNotTrusted
from loop.record import Record

T = np.arange(0.0, 400.0, 4.0)
OP = np.where(T < 100, 40.0, 50.0)
HELD = HeldInput.from_samples(T, OP)


def bump(theta: float = 11.3, *, noise: float = 0.2, seed: int = 0) -> Identification:
    pv = 20 + 2 * lag_response(HELD, T, 50.0, theta)[0]
    pv = pv + np.random.default_rng(seed).normal(0, noise, T.size)
    return identify(Record(t=T, pv=pv, op=OP))


def test_the_profile_agrees_with_the_parabola_where_errors_are_small() -> None:
    found = bump()
    assert found.intervals is not None
    low, high = profile_interval(found)
    assert low == pytest.approx(found.intervals[2, 0], abs=0.3)
    assert high == pytest.approx(found.intervals[2, 1], abs=0.3)
    inner = profile_interval(found, level=0.5)
    assert low < inner[0] < inner[1] < high


def test_the_profile_holds_in_nearly_all_repeats() -> None:
    intervals = [profile_interval(bump(seed=seed)) for seed in range(12)]
    assert sum(low <= 11.3 <= high for low, high in intervals) >= 10


def test_a_dead_time_of_nothing_has_an_interval_that_ends_there() -> None:
    low, high = profile_interval(bump(0.0, noise=1.0))
    assert low == 0
    assert 0.5 < high < 12


def test_without_noise_the_interval_shuts() -> None:
    low, high = profile_interval(bump(noise=0.0))
    assert low == pytest.approx(11.3, abs=1e-3)
    assert high == pytest.approx(11.3, abs=1e-3)


@pytest.mark.parametrize(("drift", "start"), [(0.03, 0.0), (0.0, 8.0)])
def test_a_drift_and_a_start_off_rest_are_part_of_the_profile(drift: float, start: float) -> None:
    pv = 20 + 2 * lag_response(HELD, T, 50.0, 11.3)[0] + drift * T + start * np.exp(-T / 50)
    pv = pv + np.random.default_rng(0).normal(0, 0.1, T.size)
    found = identify(Record(t=T, pv=pv, op=OP))
    assert found.drift != 0 or found.start != 0
    low, high = profile_interval(found)
    assert low < 11.3 < high
    assert high - low < 4


def test_the_bootstrap_agrees_with_the_covariance() -> None:
    found = bump()
    assert found.intervals is not None
    intervals = bootstrap_intervals(found, n=200)
    width, expected = np.diff(intervals)[:, 0], np.diff(found.intervals)[:, 0]
    np.testing.assert_allclose(width, expected, rtol=0.25)
    np.testing.assert_array_equal(intervals, bootstrap_intervals(found, n=200))


def test_coloured_noise_widens_the_bootstrap_as_well() -> None:
    rng = np.random.default_rng(2)
    wander = np.zeros(T.size)
    for i in range(1, T.size):
        wander[i] = 0.8 * wander[i - 1] + rng.normal(0, 0.2)
    pv = 20 + 2 * lag_response(HELD, T, 50.0, 11.3)[0] + wander
    found = identify(Record(t=T, pv=pv, op=OP))
    assert found.colour is not None
    assert found.colour.inflation > 2
    assert found.intervals is not None
    width = np.diff(bootstrap_intervals(found, n=100))[:, 0]
    np.testing.assert_allclose(width, np.diff(found.intervals)[:, 0], rtol=0.6)


def test_what_cannot_have_an_interval_says_why() -> None:
    refused = identify(Record(t=T, pv=np.full(T.size, 3.0), op=OP))
    with pytest.raises(FitNotTrusted, match="needs a first-order model"):
        profile_interval(refused)
    with pytest.raises(ValueError, match="between 0 and 1, got 1"):
        profile_interval(bump(), level=1)
    with pytest.raises(ValueError, match="at least 20 repeats, got 3"):
        bootstrap_intervals(bump(), n=3)
