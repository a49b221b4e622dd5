"""Rows in order of time: sorting, merging and spacing against slow readings of the same rules."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from historian.series import in_order, spacing_of
from historian.streams import GrowingArray, LineMap
from loop.record import Mode

NAN = float("nan")
rows = st.lists(
    st.tuples(st.integers(0, 12), st.sampled_from([NAN, 1.0, 2.0, 3.0])), min_size=1, max_size=40
)


@given(rows)
def test_each_time_keeps_its_last_known_value(found: list[tuple[int, float]]) -> None:
    times = np.array([time for time, _ in found], dtype=np.int64)
    values = np.array([value for _, value in found])
    series = in_order(times, {"a": values})
    expected: dict[int, float] = {}
    for time, value in found:
        if time not in expected or not np.isnan(value):
            expected[time] = value
    assert series.instants.tolist() == sorted(expected)
    assert np.array_equal(
        series.values["a"], [expected[t] for t in sorted(expected)], equal_nan=True
    )
    assert series.duplicates == len(found) - len(expected)
    if series.duplicates:
        differing = [v for t, v in found if not np.isnan(v) and v != expected[t]]
        assert series.conflicts["a"] == len(differing)


def test_modes_merge_to_the_last_known_one() -> None:
    modes = np.array([Mode.AUTO, Mode.UNKNOWN, Mode.UNKNOWN, Mode.MAN], dtype=np.int8)
    series = in_order(np.array([0, 0, 1, 2]), {"m": modes})
    assert series.values["m"].tolist() == [Mode.AUTO, Mode.UNKNOWN, Mode.MAN]
    assert series.values["m"].dtype == np.int8


def test_newest_first_is_an_order_and_not_a_disorder() -> None:
    series = in_order(np.array([3, 2, 1]), {"a": np.array([1.0, 2.0, 3.0])})
    assert series.values["a"].tolist() == [3, 2, 1]
    assert not series.disordered
    assert in_order(np.array([3, 1, 2]), {}).disordered


@pytest.mark.parametrize(
    ("times", "sample_time", "irregular", "gaps", "longest"),
    [
        ([], 0, False, 0, 0),
        ([5], 0, False, 0, 0),
        ([0, 10, 20, 30], 10, False, 0, 0),
        ([*range(0, 300, 10), 320, 330, 900], 10, False, 2, 570),
        ([0, 1, 3, 7, 15, 31, 63], 6, True, 0, 0),
        ([0, 1, 3, 7, 15, 100], 4, True, 1, 85),
    ],
)
def test_gaps_are_spacings_far_beyond_the_usual_one(
    times: list[float], sample_time: float, irregular: bool, gaps: int, longest: float
) -> None:
    spacing = spacing_of(np.array(times, dtype=np.float64))
    assert (spacing.sample_time, spacing.irregular) == (sample_time, irregular)
    assert (spacing.gaps, spacing.longest_gap) == (gaps, longest)
    ticks = spacing_of(np.array(times, dtype=np.int64) * 10**9)
    assert ticks == spacing


@given(st.lists(st.lists(st.integers(1, 1000), max_size=20), max_size=10))
def test_lines_are_found_again(blocks: list[list[int]]) -> None:
    lines = LineMap()
    whole: list[int] = []
    for block in blocks:
        ascending = sorted(set(block))
        lines.extend(np.array(ascending, dtype=np.int64))
        whole += ascending
    if whole:
        assert lines.of(np.arange(len(whole))).tolist() == whole


@pytest.mark.parametrize("expected", [0, 5, 1000])
def test_growing_arrays_hold_what_was_appended(expected: int) -> None:
    growing: GrowingArray[np.ndarray[tuple[int], np.dtype[np.float64]]] = GrowingArray(expected)
    assert GrowingArray[np.ndarray[tuple[int], np.dtype[np.float64]]]().finished().size == 0
    whole = []
    for size in (0, 3, 0, 10, 100):
        block = np.arange(size) / 7
        growing.append(block)
        whole += block.tolist()
    assert growing.finished().tolist() == whole
