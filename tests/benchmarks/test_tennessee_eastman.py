"""The Tennessee Eastman plant as 17 loops; needs the dependency group `plants`."""

import numpy as np
import pytest

from advice.plantwide import plant_oscillations
from benchmarks.eastman_plant import (
    REACTOR_TEMPERATURE,
    SAMPLE_TIME,
    STICKING,
    EastmanRun,
    available,
    eastman_run,
)
from loop.record import Mode

pytestmark = pytest.mark.skipif(
    not available(), reason="tep-studio is not installed (dependency group `plants`)"
)


@pytest.fixture(scope="module")
def sticking() -> EastmanRun:
    return eastman_run(14, hours=3.0, settling=0.5)


def test_the_17_loops_have_known_ranges_and_true_stems(sticking: EastmanRun) -> None:
    tags = [record.tag for record in sticking.records]
    assert len(tags) == 17
    assert {*sticking.op_ranges} == {*tags}
    assert {tag for loops in STICKING.values() for tag in loops} <= {*sticking.stems}
    for record in sticking.records:
        low, high = sticking.op_ranges[record.tag]
        assert low <= np.min(record.op)
        assert np.max(record.op) <= high
        assert record.sample_time == pytest.approx(SAMPLE_TIME)
        assert record.mode is not None
        assert (record.mode[0] == Mode.MAN) == (record.tag == "%G in product")


def test_three_hours_of_a_sticking_cooling_valve_are_traced_to_it(sticking: EastmanRun) -> None:
    (group,) = plant_oscillations(sticking.records).groups
    first, *victims = group.suspects
    assert first.tag == REACTOR_TEMPERATURE
    assert "Reactor pressure" in {one.tag for one in victims}
    # The true stem rests for a good part of the time, as a sticking one does; in normal operation,
    # where OP moves with every scan, it rests for 2 %.
    assert np.mean(np.abs(np.diff(sticking.stems[REACTOR_TEMPERATURE])) < 1e-3) > 0.3
