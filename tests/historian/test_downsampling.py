import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from historian.downsampling import Picture, downsample
from loop.signals import Real

NAN = math.nan


def noisy(n: int) -> tuple[Real, Real]:
    chance = np.random.default_rng(7)
    return np.arange(float(n)), np.cumsum(chance.normal(size=n))


def test_a_short_signal_stays_as_it_is() -> None:
    t, values = noisy(100)
    picture = downsample(t, values, 100)
    np.testing.assert_array_equal(picture.t, t)
    np.testing.assert_array_equal(picture.values, values)


def test_a_long_signal_keeps_its_ends_its_extremes_and_its_shape() -> None:
    t, values = noisy(86_400)
    values[40_000] += 1000  # one lone spike
    picture = downsample(t, values, 500)
    assert 400 < picture.t.size <= 500
    assert {values.max(), values.min(), values[0], values[-1]} <= set(picture.values.tolist())
    kept = np.interp(t, picture.t, picture.values)
    near_spike = np.abs(t - 40_000) < 1000
    swing = np.ptp(values[~near_spike])
    assert np.max(np.abs(kept - values)[~near_spike]) < 0.1 * swing


def test_a_gap_stays_visible_between_its_two_sides() -> None:
    t, values = noisy(10_000)
    values[3000:4000] = NAN
    picture = downsample(t, values, 100)
    (mark,) = np.flatnonzero(np.isnan(picture.values))
    assert picture.t[mark - 1] == 2999
    assert picture.t[mark + 1] == 4000
    assert picture.t[mark] == 3499.5


def test_a_gap_can_be_told_by_distance_instead_of_missing_values() -> None:
    t = np.r_[np.arange(50.0), 90 + np.arange(50.0)]
    values = np.where(np.arange(100) % 2, NAN, 1.0)  # every other row belongs to another signal
    picture = downsample(t, values, 1000, max_gap=5.0)
    assert np.count_nonzero(np.isnan(picture.values)) == 1
    assert np.count_nonzero(~np.isnan(picture.values)) == 50


def test_more_gaps_than_points_still_show_as_gaps() -> None:
    t = np.arange(1000.0)
    values = np.where(t % 2, NAN, np.sin(t))
    picture = downsample(t, values, 51)
    assert picture.t.size <= 51
    assert (
        np.count_nonzero(np.isnan(picture.values))
        == np.count_nonzero(~np.isnan(picture.values)) - 1
    )


def test_no_value_gives_no_point() -> None:
    assert downsample(np.arange(5.0), np.full(5, NAN), 10).t.size == 0
    assert downsample(np.empty(0), np.empty(0), 10).t.size == 0


def test_huge_and_tiny_values_are_no_trouble() -> None:
    t = np.arange(1000.0)
    for size in (1e308, 5e-324, 0.0):
        values = size * np.where(t % 7 == 0, -1.0, 1.0)
        picture = downsample(t, values, 50)
        assert picture.values.min() == values.min()
        assert picture.values.max() == values.max()


@pytest.mark.parametrize("n", [0, -3])
def test_a_plot_needs_a_point(n: int) -> None:
    with pytest.raises(ValueError, match="at least one point"):
        downsample(np.arange(5.0), np.ones(5), n)


def test_a_signal_in_parts_gives_the_same_picture_as_the_whole() -> None:
    t, values = noisy(50_000)
    values[20_000:21_000] = NAN  # over the border of two parts
    whole = downsample(t, values, 300)
    for max_gap in (None, 5.0):
        picture = Picture(300, max_gap=max_gap)
        for start in range(0, 50_000, 20_500):
            picture.add(t[start : start + 20_500], values[start : start + 20_500])
        series = picture.series()
        np.testing.assert_array_equal(series.t, whole.t)
        np.testing.assert_array_equal(series.values, whole.values)
        np.testing.assert_array_equal(picture.series().t, whole.t)  # asked twice


def test_a_gap_at_the_border_of_two_parts_is_seen() -> None:
    for first, second in (([1, NAN], [3, 4]), ([1, 2], [NAN, 4]), ([1, 2], [3, 4])):
        picture = Picture(10)
        picture.add(np.arange(2.0), np.array(first, float))
        picture.add(2 + np.arange(2.0), np.array(second, float))
        marks = np.count_nonzero(np.isnan(picture.series().values))
        assert marks == (NAN in first or math.isnan(first[1]) or math.isnan(second[0]))
    picture = Picture(10)
    picture.add(np.array([0.0]), np.array([1.0]))
    picture.add(np.array([1.0]), np.array([NAN]))  # a part of its own without a value
    picture.add(np.array([2.0]), np.array([1.0]))
    assert np.isnan(picture.series().values).tolist() == [False, True, False]


def test_a_signal_too_long_to_be_held_keeps_its_extremes_and_gaps() -> None:
    picture = Picture(200, max_gap=2.0)
    chance = np.random.default_rng(1)
    extremes = [math.inf, -math.inf]
    for part in range(12):
        t = part * 100_000.0 + np.arange(100_000.0) + (1000 if part > 5 else 0)
        values = chance.normal(size=t.size)
        extremes = [min(extremes[0], values.min()), max(extremes[1], values.max())]
        picture.add(t, values)
    series = picture.series()
    assert series.t.size <= 200
    assert [np.nanmin(series.values), np.nanmax(series.values)] == extremes
    (mark,) = np.flatnonzero(np.isnan(series.values))
    assert series.t[mark - 1] == 599_999
    assert series.t[mark + 1] == 601_000


@given(
    values=hnp.arrays(
        np.float64, st.integers(0, 300), elements=st.one_of(st.just(NAN), st.floats(-1e308, 1e308))
    ),
    n=st.integers(1, 80),
    max_gap=st.sampled_from([None, 1.5, 3.0]),
)
def test_never_more_points_never_an_invented_value(
    values: Real, n: int, max_gap: float | None
) -> None:
    t = np.cumsum(1 + np.arange(values.size) % 3 / 2)
    picture = downsample(t, values, n, max_gap=max_gap)
    assert picture.t.size <= n
    assert np.all(np.diff(picture.t) > 0)
    original = dict(zip(t.tolist(), values.tolist(), strict=True))
    shown = ~np.isnan(picture.values)
    for time, value in zip(picture.t[shown].tolist(), picture.values[shown].tolist(), strict=True):
        assert original[time] == value
    known = values[~np.isnan(values)]
    assert bool(shown.any()) == bool(known.size)
    if n >= 8 and known.size:
        assert {known.min(), known.max(), known[0], known[-1]} <= set(picture.values.tolist())
    for mark in np.flatnonzero(~shown):  # a mark stands between two points with a gap between them
        assert shown[mark - 1]
        assert shown[mark + 1]
