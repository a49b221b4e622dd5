"""Loops that swing after loads without a steady oscillation are tuned too tight."""

import numpy as np

from advice.assess import assess
from benchmarks.virtual_loops import State, virtual_loops
from loop.plants import PLANT, routine_operation
from loop.record import Record
from monitoring.acf_decay import acf_decay
from monitoring.basis import Confidence
from monitoring.cause import Action, Cause
from monitoring.load_responses import load_responses
from monitoring.loop_signals import Stretch


def test_a_loop_too_tight_for_its_loads_is_called_aggressive() -> None:
    tight = next(one for one in PLANT if one.tag == "TIC-203")
    record = routine_operation(tight, duration=25_000.0, seed=1)
    found = assess(record, kind="temperature", pv_range=tight.pv_range).diagnosis
    assert found.cause is Cause.TUNING
    assert found.action is Action.RETUNE
    assert found.evidence[0].startswith("Aggressive: OP swings after loads")


def test_healthy_loops_do_not_swing_and_decay_slowly_at_once() -> None:
    both = 0
    for one in virtual_loops(State.HEALTHY, 60, samples=2000, seed=31):
        stretch = Stretch(first=0, dt=1.0, pv=one.pv, op=one.op, sp=one.sp, share=1.0)
        swinging = load_responses(stretch).swinging
        both += swinging and acf_decay(stretch.error, 1.0).lively
    assert both == 0


def test_tuning_is_left_open_where_the_autocorrelation_decays_slowly() -> None:
    open_cases = {State.HEALTHY: 0, State.TIGHT: 0}
    for state in open_cases:
        for one in virtual_loops(state, 30, samples=2000, seed=32):
            record = Record(t=np.arange(2000.0), pv=one.pv, op=one.op, sp=one.sp)
            said = assess(record, op_range=(-1e4, 1e4)).diagnosis
            if said.cause is Cause.HEALTHY and Cause.TUNING in said.others:
                assert said.confidence is not Confidence.HIGH
                assert any("decays with" in sentence for sentence in said.evidence)
                open_cases[state] += 1
    assert open_cases[State.TIGHT] >= 9
    assert open_cases[State.HEALTHY] <= 5
