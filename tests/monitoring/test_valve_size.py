import numpy as np
import pytest

from loop.record import Mode
from monitoring.loop_signals import LoopSignals
from monitoring.valve_size import ValveSize, valve_range

OP = np.linspace(0.0, 100.0, 401)


def at_work(op: np.ndarray, mode: Mode = Mode.AUTO) -> LoopSignals:
    return LoopSignals(
        dt=1.0, pv=op, op=op, mode=np.full(op.size, mode, dtype=np.int8), op_range=(0.0, 100.0)
    )


@pytest.mark.parametrize(
    ("op", "size"),
    [
        (OP / 10, ValveSize.OVERSIZED),
        (90 + OP / 10, ValveSize.UNDERSIZED),
        (OP, ValveSize.RIGHT),
    ],
)
def test_the_size_of_a_valve_shows_in_where_it_works(op: np.ndarray, size: ValveSize) -> None:
    found = valve_range(at_work(op))
    assert found.size is size
    assert found.middle is not None
    assert found.middle == pytest.approx(float(np.median(op)))
    assert found.low is not None
    assert found.high is not None
    assert found.low < found.middle < found.high


def test_a_valve_that_was_never_in_automatic_is_not_judged() -> None:
    found = valve_range(at_work(OP, Mode.MAN))
    assert found.size is ValveSize.UNDECIDED
    assert found.basis.refused
