"""Before and after a change, as records come from the plant."""

import numpy as np
import pytest

from advice.effect import effect
from loop.record import Mode, Record
from monitoring.before_after import Change


def routine(seed: int, size: float, *, dt: float = 10.0, mode: Mode | None = Mode.AUTO) -> Record:
    """A day of a loop whose error has a standard deviation of about `size`."""
    n = round(86_400 / dt)
    noise = np.random.default_rng(seed).normal(size=n)
    return Record(
        t=np.arange(n) * dt, pv=50.0 + size * noise, op=np.full(n, 40.0), sp=np.full(n, 50.0),
        mode=None if mode is None else np.full(n, mode, np.int8),
    )  # fmt: skip


def test_half_the_error_is_better_and_the_ratio_says_so() -> None:
    found = effect(routine(1, 2.0), routine(2, 1.0))
    assert found.comparison.change is Change.BETTER
    assert found.comparison.ratio == pytest.approx(0.5, rel=0.03)
    assert (found.controlled_before, found.controlled_after) == (1.0, 1.0)


def test_the_other_way_round_it_is_worse_by_the_inverse() -> None:
    there, back = (effect(*pair).comparison.ratio for pair in _pairs())
    assert there is not None
    assert back is not None
    assert there * back == pytest.approx(1.0)
    assert effect(routine(2, 1.0), routine(1, 2.0)).comparison.change is Change.WORSE


def _pairs() -> tuple[tuple[Record, Record], tuple[Record, Record]]:
    first, second = routine(1, 2.0), routine(2, 1.0)
    return (first, second), (second, first)


def test_the_same_error_shows_no_difference() -> None:
    assert effect(routine(1, 1.0), routine(2, 1.0)).comparison.change is Change.NO_DIFFERENCE


def test_a_period_in_manual_cannot_be_compared() -> None:
    found = effect(routine(1, 1.0), routine(2, 1.0, mode=Mode.MAN))
    assert found.comparison.change is Change.NOT_COMPARABLE
    assert found.controlled_after == 0.0
    assert found.comparison.basis.reasons


def test_without_modes_the_set_point_alone_is_taken() -> None:
    found = effect(routine(1, 2.0, mode=None), routine(2, 1.0, mode=None))
    assert found.comparison.change is Change.BETTER


def test_without_a_set_point_there_is_no_error_to_compare() -> None:
    bare = Record(t=np.arange(100.0), pv=np.arange(100.0), op=np.zeros(100))
    assert effect(bare, bare).comparison.change is Change.NOT_COMPARABLE


def test_a_single_sample_is_no_period() -> None:
    one = Record(t=np.zeros(1), pv=np.ones(1), op=np.ones(1), sp=np.ones(1))
    found = effect(one, one)
    assert found.comparison.change is Change.NOT_COMPARABLE
    assert found.sample_time is None


def test_periods_of_unlike_sample_times_are_compared_on_the_coarser() -> None:
    found = effect(routine(1, 2.0, dt=5.0), routine(2, 1.0, dt=10.0))
    assert found.sample_time == 10.0


def test_bursts_months_apart_are_not_put_on_a_grid_of_microseconds() -> None:
    burst = np.arange(100) * 1e-6
    t = np.r_[burst, burst + 2e6]
    bursts = Record(t=t, pv=np.zeros(200), op=np.zeros(200), sp=np.zeros(200))
    found = effect(bursts, bursts)
    assert found.comparison.change is Change.NOT_COMPARABLE
    assert found.sample_time is None


def test_a_mode_that_is_known_nowhere_is_as_good_as_none() -> None:
    rng = np.random.default_rng(8)

    def period(size: float, *, codes: bool) -> Record:
        return Record(
            t=np.arange(2000.0), pv=50 + size * rng.normal(size=2000), op=np.full(2000, 40.0),
            sp=np.full(2000, 50.0),
            mode=np.full(2000, Mode.UNKNOWN, dtype=np.int8) if codes else None,
        )  # fmt: skip

    for codes in (False, True):
        found = effect(period(1.0, codes=codes), period(0.5, codes=codes))
        assert found.comparison.change is Change.BETTER
        assert found.controlled_before == found.controlled_after == 1
