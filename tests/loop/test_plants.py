"""The simulated plant: what is known about it must be found in its records."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from loop.controller import PID
from loop.margins import margins
from loop.measures import total_variation
from loop.plants import PLANT, SimulatedLoop, relay_test, routine_operation, step_test
from loop.process import IPDT, gain_sign, static_gain
from loop.record import Mode, Record

EVERY_LOOP = pytest.mark.parametrize("loop", PLANT, ids=lambda loop: loop.tag)
BY_TAG = {loop.tag: loop for loop in PLANT}


def records(loop: SimulatedLoop, seed: int) -> list[Record]:
    return [
        step_test(loop, seed=seed),
        routine_operation(loop, duration=30 * loop.hold, seed=seed),
        relay_test(loop, seed=seed),
    ]


@EVERY_LOOP
def test_a_seed_gives_the_same_plant_everywhere(loop: SimulatedLoop) -> None:
    for once, again, other in zip(
        records(loop, 1), records(loop, 1), records(loop, 2), strict=True
    ):
        np.testing.assert_array_equal(once.pv, again.pv)
        np.testing.assert_array_equal(once.op, again.op)
        assert np.any(once.pv != other.pv)


@EVERY_LOOP
def test_records_stay_within_the_ranges_of_their_loop(loop: SimulatedLoop) -> None:
    for record in records(loop, 3):
        assert record.tag == loop.tag
        assert record.pv_unit == loop.pv_unit
        assert loop.pv_range[0] < record.pv.min() < record.pv.max() < loop.pv_range[1]
        assert loop.op_range[0] <= record.op.min() < record.op.max() <= loop.op_range[1]
        np.testing.assert_allclose(
            record.pv / loop.resolution, np.round(record.pv / loop.resolution), atol=1e-6
        )
        assert record.sample_time == pytest.approx(loop.scan_time)


@EVERY_LOOP
def test_a_step_test_shows_the_true_gain(loop: SimulatedLoop) -> None:
    record = step_test(loop)
    assert record.mode is not None
    assert np.all(record.mode == Mode.MAN)
    ends = [
        record.between((k + 0.8) * loop.hold, (k + 1) * loop.hold - loop.scan_time)
        for k in range(5)
    ]
    levels = np.array([end.pv.mean() for end in ends])
    if isinstance(loop.process, IPDT):
        slope = np.polyfit(ends[1].t, ends[1].pv, 1)[0]
        assert slope / loop.step == pytest.approx(loop.process.K, rel=0.15)
    else:
        K = static_gain(loop.process)
        np.testing.assert_allclose(
            np.diff(levels) / (loop.step * np.array([1, -1, -1, 1])), K, rtol=0.03
        )


@EVERY_LOOP
def test_a_relay_test_cycles_as_often_as_asked(loop: SimulatedLoop) -> None:
    record = relay_test(loop, cycles=6)
    assert np.count_nonzero(np.diff(record.op)) >= 2 * 6
    assert np.unique(record.op).size == 2
    swing = np.ptp(record.pv)
    assert swing > 8 * loop.noise


@EVERY_LOOP
def test_every_controller_has_the_action_of_its_process(loop: SimulatedLoop) -> None:
    assert loop.controller.action.sign == gain_sign(loop.process)
    assert margins(loop.process, loop.controller, sample_time=loop.scan_time).gain > 1


def test_the_plant_has_one_sluggish_and_one_oscillating_loop() -> None:
    def gain_margin(tag: str) -> float:
        return margins(BY_TAG[tag].process, BY_TAG[tag].controller).gain

    assert gain_margin("TIC-202") > 15
    assert gain_margin("TIC-203") < 1.5
    restless, calm = (
        routine_operation(BY_TAG[tag], duration=7200, seed=4) for tag in ("TIC-203", "TIC-201")
    )
    assert total_variation(restless.op) / len(restless) > 5 * total_variation(calm.op) / len(calm)


def test_routine_data_are_in_automatic_and_carry_their_start() -> None:
    start = datetime(2026, 5, 4, 6, tzinfo=UTC)
    record = routine_operation(PLANT[0], duration=600, start=start)
    assert record.mode is not None
    assert np.all(record.mode == Mode.AUTO)
    assert record.start == start
    assert record.span == 600


def test_a_record_needs_a_scan() -> None:
    with pytest.raises(ValueError, match="at least one scan"):
        routine_operation(PLANT[0], duration=0.1)


def test_a_better_controller_may_be_tried_on_the_same_plant() -> None:
    """Same seed, same noise and loads: only the controller differs, and with it the variance."""
    loop = BY_TAG["TIC-203"]
    calmer = replace(loop, controller=PID(Kc=2.4, Ti=95, action=loop.controller.action))
    before, after = (routine_operation(x, duration=7200, seed=4) for x in (loop, calmer))
    np.testing.assert_array_equal(before.sp, after.sp)
    assert total_variation(after.op) < 0.5 * total_variation(before.op)
