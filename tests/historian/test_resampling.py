import math
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from historian.resampling import Between, Series, even_record, resample, usual_gap
from loop.record import Mode, Record
from loop.signals import Real

NAN = math.nan
METHODS: tuple[Between, ...] = ("previous", "linear", "mean")


def array(*values: float) -> Real:
    return np.array(values, dtype=np.float64)


def values(
    t: Real, signal: Real, step: float, hold: Between, max_gap: float = math.inf
) -> list[float | None]:
    """Resample and write gaps as None, which a list can be compared with."""
    even = resample(t, signal, step, hold=hold, max_gap=max_gap)
    return [None if math.isnan(value) else float(value) for value in even.values]


def test_an_output_keeps_its_value_until_the_next_sample() -> None:
    assert values(array(0, 2.5, 5), array(10, 20, 30), 1, "previous") == [10, 10, 10, 20, 20, 30]


def test_a_process_variable_goes_straight_between_samples() -> None:
    assert values(array(0, 4), array(10, 30), 1, "linear") == [10, 15, 20, 25, 30]


def test_the_mean_is_taken_around_a_grid_point_and_shifts_nothing() -> None:
    t = np.arange(-0.45, 10.5, 0.1)
    ramp = resample(t, 3 * t, 1.0, hold="mean", max_gap=1.0, start=0.0)
    np.testing.assert_allclose(ramp.values, 3.0 * np.arange(11), atol=1e-12)


def test_the_mean_falls_back_to_a_straight_line_where_no_sample_is_near() -> None:
    t, signal = array(-0.25, 0.25, 4.25), array(1, 3, 7)
    even = resample(t, signal, 1.0, hold="mean", max_gap=9.0, start=0.0)
    assert even.values.tolist() == [2, 3.75, 4.75, 5.75, 7]


def test_the_mean_of_an_even_record_is_what_pandas_says() -> None:
    chance = np.random.default_rng(3)
    t = np.arange(600.0)
    signal = chance.normal(size=600)
    ours = resample(t, signal, 10.0, hold="mean", max_gap=5.0, start=5.0, end=589.0)
    shifted = pd.Series(signal, index=pd.to_timedelta(t, unit="s"))
    theirs = shifted.resample("10s").mean()  # [0, 10) is what lies within 5 s of t = 5
    np.testing.assert_allclose(ours.values, theirs.to_numpy()[:59], atol=1e-12)


@pytest.mark.parametrize("hold", METHODS)
def test_nothing_is_invented_in_a_gap(hold: Between) -> None:
    t, signal = array(0, 1, 2, 7, 8), array(1, 2, 3, 8, 9)
    assert values(t, signal, 1, hold, max_gap=2.0) == [1, 2, 3, None, None, None, None, 8, 9]


@pytest.mark.parametrize("hold", METHODS)
def test_samples_without_a_value_make_a_gap_by_their_length_only(hold: Between) -> None:
    t, signal = np.arange(9.0), array(1, NAN, 1, 1, NAN, NAN, NAN, 1, 1)
    bridged = [1, 1, 1, 1, None, None, None, 1, 1]
    assert values(t, signal, 1, hold, max_gap=2.0) == bridged


@pytest.mark.parametrize("hold", METHODS)
def test_nothing_is_carried_beyond_the_first_and_last_value(hold: Between) -> None:
    t, signal = np.arange(5.0), array(NAN, 2, 2, 2, NAN)
    assert values(t, signal, 1, hold) == [None, 2, 2, 2, None]
    wide = resample(t, signal, 1, hold=hold, max_gap=9, start=-2.0, end=7.0)
    assert wide.t.tolist() == [*range(-2, 8)]
    assert np.flatnonzero(~np.isnan(wide.values)).tolist() == [3, 4, 5]


@pytest.mark.parametrize("hold", METHODS)
def test_a_signal_without_any_value_stays_without(hold: Between) -> None:
    assert values(np.arange(3.0), np.full(3, NAN), 1, hold) == [None, None, None]


def test_a_grid_that_begins_after_its_end_is_empty() -> None:
    assert resample(array(0), array(1), 1, hold="linear", max_gap=1, start=5, end=4).t.size == 0


def test_rounded_times_still_meet_the_grid() -> None:
    t = 1.7e9 + 0.1 * np.arange(1000)
    even = resample(t, np.arange(1000.0), 0.1, hold="previous", max_gap=1.0)
    np.testing.assert_array_equal(even.values, np.arange(1000.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"step": 0.0}, "step must be positive, got 0.0"),
        ({"step": math.inf}, "step must be positive"),
        ({"max_gap": 0.0}, "max_gap must be positive"),
        ({"max_gap": NAN}, "max_gap must be positive"),
        ({"t": array(0, 0)}, "increase strictly"),
        ({"t": array(0, math.inf)}, "finite"),
        ({"t": array(0)}, "as long"),
        ({"t": array(), "values": array()}, "no sample"),
    ],
)
def test_what_cannot_be_put_on_a_grid_is_refused(change: dict[str, object], words: str) -> None:
    good: dict[str, object] = {"t": array(0, 1), "values": array(1, 2), "step": 1.0, "max_gap": 5.0}
    with pytest.raises(ValueError, match=words):
        resample(**(good | change), hold="linear")


def test_the_usual_gap_shows_one_lost_sample_and_forgives_uneven_steps() -> None:
    lost = np.delete(np.arange(100.0), 50)
    assert usual_gap(lost, np.ones(99)) == 1.5
    uneven = np.cumsum(1 + np.arange(100.0) % 7)
    assert usual_gap(uneven, np.ones(100)) > 7
    with_holes = np.where(np.arange(100) % 2, NAN, 1.0)  # another signal is stamped in between
    assert usual_gap(np.arange(100.0), with_holes) == 3.0
    assert usual_gap(array(0), array(1)) == math.inf


def test_an_even_record_holds_outputs_and_lets_the_process_move() -> None:
    record = Record(
        t=[0, 2, 4, 20],
        pv=[0, 2, 4, 20],
        op=[50, NAN, 60, 60],
        sp=[1, NAN, NAN, 2],
        mode=[Mode.AUTO, Mode.UNKNOWN, Mode.MAN, Mode.MAN],
        start=datetime(2026, 1, 1, tzinfo=UTC),
        tag="TIC-101",
    )
    even = even_record(record, 1.0, max_gap=5.0, pv="linear", held_gap=math.inf)
    assert even.t.tolist() == [*range(21)]
    np.testing.assert_array_equal(even.pv, [0, 1, 2, 3, 4, *[NAN] * 15, 20])
    np.testing.assert_array_equal(even.op, [50] * 4 + [60] * 17)
    assert even.sp is not None
    assert even.mode is not None
    np.testing.assert_array_equal(even.sp, [1] * 20 + [2])
    np.testing.assert_array_equal(even.mode, [1] * 4 + [0] * 17)
    assert (even.start, even.tag) == (record.start, "TIC-101")
    short = even_record(record, 1.0, max_gap=5.0)
    assert short.mode is not None
    np.testing.assert_array_equal(short.mode, [1] * 4 + [0] + [-1] * 15 + [0])


def test_a_record_without_set_point_and_mode_stays_without() -> None:
    even = even_record(Record(t=[0, 2], pv=[0, 2], op=[1, 1]), 1.0, max_gap=5.0)
    assert even.sp is None
    assert even.mode is None


@st.composite
def series(draw: st.DrawFn) -> Series:
    """Draw uneven times with values of which some are missing."""
    steps = draw(st.lists(st.sampled_from([0.25, 1.0, 1.5, 7.0, 40.0]), min_size=1, max_size=30))
    cells = st.one_of(st.just(NAN), st.floats(-1e300, 1e300))
    drawn = draw(hnp.arrays(np.float64, len(steps), elements=cells))
    return Series(t=np.cumsum(steps), values=drawn)


@given(signal=series(), step=st.sampled_from([0.3, 1.0, 5.0]), hold=st.sampled_from(METHODS))
def test_a_signal_on_its_own_grid_stays_as_it_is(
    signal: Series, step: float, hold: Between
) -> None:
    once = resample(signal.t, signal.values, step, hold=hold, max_gap=8.0)
    twice = resample(once.t, once.values, step, hold=hold, max_gap=8.0)
    np.testing.assert_array_equal(twice.t, once.t)
    gap = np.isnan(once.values)
    np.testing.assert_array_equal(twice.values[~gap], once.values[~gap])


@given(
    signal=series(),
    step=st.sampled_from([0.3, 1.0, 5.0]),
    hold=st.sampled_from(METHODS),
    max_gap=st.sampled_from([1.0, 1.5, 10.0]),
)
def test_no_value_leaves_the_range_or_lies_in_a_gap(
    signal: Series, step: float, hold: Between, max_gap: float
) -> None:
    even = resample(signal.t, signal.values, step, hold=hold, max_gap=max_gap)
    known = ~np.isnan(signal.values)
    found = ~np.isnan(even.values)
    if not known.any():
        assert not found.any()
        return
    times, cells = signal.t[known], signal.values[known]
    assert np.all(even.values[found] >= cells.min())
    assert np.all(even.values[found] <= cells.max())
    for instant in even.t[found]:
        before, after = times[times <= instant + 1e-6], times[times >= instant - 1e-6]
        assert before.size
        assert after.size
        assert after[0] - before[-1] <= max_gap + 1e-9
