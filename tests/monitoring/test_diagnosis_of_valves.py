import numpy as np

from advice.assess import assess
from loop.record import Record
from monitoring.basis import Confidence
from monitoring.cause import Action, Cause


def test_a_valve_that_rather_sticks_is_named_with_what_keeps_it_undecided() -> None:
    rng = np.random.default_rng(2)
    t = np.arange(750.0)
    op = 25 + 0.1 * np.abs((t / 250) % 2 - 1)  # within a sound valve's dead band
    offset = np.where((t // 250) % 2 == 0, 1.0, -1.0)  # against an error that stays
    pv = 50 - offset + 0.1 * rng.normal(size=t.size)
    found = assess(Record(t=10 * t, pv=pv, op=op, sp=np.full(t.size, 50.0)), kind="analyser")
    said = found.diagnosis
    assert said.cause is Cause.VALVE
    assert said.confidence is Confidence.LOW
    assert said.action is Action.CHECK_VALVE
    assert "OP moved by only 0.1 % of its range" in said.evidence[0]
    assert "put the loop in manual" in said.evidence[1]
