import json
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from advice.assess import assess, assess_signals
from advice.assessment_body import assessment_body
from loop.controller import PID
from loop.controller import Action as Action_
from loop.digital_pid import OutputLimits
from loop.plants import PLANT, routine_operation
from loop.process import FOPDT, IPDT, SOPDT, PureDelay, TransferFunction
from loop.record import Mode, Record
from loop.simulation import simulate
from loop.valve import Choudhury
from monitoring.cause import Action, Cause
from monitoring.known_loop import KnownLoop
from monitoring.oscillation import OscillationVerdict
from monitoring.scorecard import GradeWord
from monitoring.stiction_result import StictionVerdict


def record(*, valve: Choudhury | None = None, n: int = 2000, **changes: Any) -> Record:
    """A flow loop in automatic, healthy unless its valve sticks."""
    rng = np.random.default_rng(5)
    run = simulate(
        FOPDT(K=1.0, tau=10.0, theta=3.0), PID(Kc=1.4, Ti=10.0), t_end=n - 1.0, dt=1.0, sp=50.0,
        load=np.where(np.arange(n) < 10, 0.0, 3.0), noise=0.08, rng=rng, valve=valve,
        pv0=50.0, op0=50.0,
    )  # fmt: skip
    signals = {"t": run.t, "pv": run.pv, "op": run.op, "sp": run.sp}
    signals["mode"] = np.full(n, Mode.AUTO, dtype=np.int8)
    return Record(**(signals | changes), tag="FIC-1")


def test_a_sticking_valve_is_named_and_the_valve_is_to_be_checked() -> None:
    found = assess(record(valve=Choudhury(S=5.0, J=3.0)), kind="flow", pv_range=(0.0, 100.0))
    assert found.indices is not None
    assert found.indices.control is not None
    assert found.indices.control.oscillation.verdict is OscillationVerdict.PERSISTENT
    assert found.indices.control.stiction.verdict is StictionVerdict.STICTION
    assert found.diagnosis.cause is Cause.VALVE
    assert found.diagnosis.action is Action.CHECK_VALVE
    assert not found.indices.control.minimum_variance.comparable
    assert found.grade.word is not GradeWord.GOOD


def test_a_healthy_loop_is_healthy_and_graded_good() -> None:
    found = assess(record(), kind="flow", pv_range=(0.0, 100.0), delay=3.0)
    assert found.diagnosis.cause is Cause.HEALTHY
    assert found.diagnosis.action is Action.NOTHING
    assert found.grade.word is GradeWord.GOOD
    assert found.grade.points == pytest.approx(
        sum(p.weight * p.points for p in found.grade.parts if p.points is not None)
        / sum(p.weight for p in found.grade.parts if p.points is not None)
    )


def test_the_loop_of_the_plant_that_is_too_tight_is_not_called_healthy() -> None:
    loop = next(one for one in PLANT if one.tag == "TIC-203")
    found = assess(
        routine_operation(loop, duration=40_000.0), kind="temperature", pv_range=loop.pv_range
    )
    assert found.diagnosis.cause is not Cause.VALVE


def test_a_loop_in_manual_is_not_in_use() -> None:
    found = assess(record(mode=np.full(2000, Mode.MAN)))
    assert found.diagnosis.cause is Cause.NOT_IN_USE
    assert found.indices is not None
    assert found.indices.control is None


def test_a_loop_at_its_limit_is_constrained() -> None:
    op = np.full(2000, 100.0)
    op[:5] = 99.0
    found = assess(record(op=op))
    assert found.diagnosis.cause is Cause.CONSTRAINT
    assert "upper" in found.diagnosis.evidence[0]


def test_a_set_point_that_swings_is_sought_upstream() -> None:
    rng = np.random.default_rng(2)
    sp = 50 + 4 * np.sin(np.arange(2000) * 2 * np.pi / 80)
    run = simulate(
        FOPDT(K=1.0, tau=10.0, theta=3.0), PID(Kc=1.4, Ti=10.0), t_end=1999.0, dt=1.0, sp=sp,
        noise=0.3, rng=rng, pv0=50.0, op0=50.0,
    )  # fmt: skip
    found = assess(Record(t=run.t, pv=run.pv, op=run.op, sp=run.sp), kind="flow")
    assert (found.diagnosis.cause, found.diagnosis.action) == (
        Cause.DISTURBANCE, Action.LOOK_UPSTREAM,
    )  # fmt: skip


def test_a_frozen_sensor_is_named() -> None:
    whole = record()
    pv = whole.pv.copy()
    pv[500:1500] = pv[500]
    found = assess(record(pv=pv))
    assert found.diagnosis.cause is Cause.SENSOR
    assert Cause.VALVE in found.diagnosis.others
    assert any("noise stopped too" in word for word in found.diagnosis.evidence)
    assert any("put the loop in manual" in word for word in found.diagnosis.evidence)


def test_an_uneven_record_is_put_on_a_grid_first() -> None:
    whole = record(valve=Choudhury(S=5.0, J=3.0))
    assert whole.sp is not None
    kept = np.random.default_rng(1).random(2000) > 0.1
    uneven = Record(t=whole.t[kept], pv=whole.pv[kept], op=whole.op[kept], sp=whole.sp[kept])
    found = assess(uneven, kind="flow")
    assert found.resampled
    assert found.samples == pytest.approx(2000, abs=5)
    assert found.diagnosis.cause is Cause.VALVE


@pytest.mark.parametrize(
    ("signals", "why"),
    [
        ({"t": [], "pv": [], "op": []}, "at least one sample"),
        ({"t": [0.0, 2.0, 1.0], "pv": [1.0] * 3, "op": [1.0] * 3}, "increase strictly"),
        ({"t": [0.0], "pv": [1.0], "op": [1.0]}, "a single sample"),
        ({"t": [0.0, 1.0, 2.0], "pv": [1.0] * 3, "op": [1.0] * 3}, "3 samples"),
        ({"t": np.r_[0.0, np.arange(1e6, 1e6 + 99)], "pv": np.ones(100), "op": np.ones(100)},
         "far too uneven"),
        ({"t": np.arange(99.0), "pv": np.full(99, np.nan), "op": np.ones(99)}, "0 samples"),
        ({"t": np.arange(99.0), "pv": np.ones(99), "op": np.ones(99)}, "neither PV nor OP"),
        ({"t": np.arange(99.0), "pv": np.ones(98), "op": np.ones(99)}, "as long as t"),
    ],
)  # fmt: skip
def test_what_cannot_be_assessed_says_why(signals: dict[str, Any], why: str) -> None:
    found = assess_signals(**signals, tag="X")
    assert not found.assessable
    assert found.diagnosis.cause is Cause.NOT_ASSESSABLE
    assert why in found.diagnosis.evidence[0]
    assert found.grade.word is GradeWord.NOT_ASSESSABLE
    json.dumps(assessment_body(found), allow_nan=False)


def test_impossible_questions_are_refused() -> None:
    with pytest.raises(ValueError, match="not a valid LoopKind"):
        assess(record(), kind="speed")
    with pytest.raises(ValueError, match="no score profile"):
        assess(record(), profile="perfect")
    with pytest.raises(ValueError, match="delay must be zero"):
        assess(record(), delay=-1.0)
    with pytest.raises(ValueError, match="tau_c must lie within"):
        assess(record(), tau_c=0.0)


def test_the_body_is_plain_json_and_the_same_for_the_same_data() -> None:
    first, second = (
        assessment_body(assess(record(valve=Choudhury(S=5.0, J=3.0)), kind="flow"))
        for _ in range(2)
    )
    text = json.dumps(first, allow_nan=False)
    assert text == json.dumps(second, allow_nan=False)
    body = json.loads(text)
    assert body["assessable"] is True
    assert body["indices"]["usage"]["modes"] == {"AUTO": 1.0}
    assert body["indices"]["control"]["stiction"]["verdict"] == "stiction"


# Nine digits of a number: no instrument shows more, and none shows 1e-300.
MEASURED = st.floats(-1e6, 1e6).map(lambda value: round(value, 3))
VALUES = MEASURED | st.just(float("nan")) | st.sampled_from([0.0, 50.0, 100.0])


SHEETS = [
    KnownLoop(process=FOPDT(K=1.0, tau=10.0, theta=3.0), controller=PID(Kc=1.4, Ti=10.0)),
    KnownLoop(process=IPDT(K=-1e-3, theta=0.0)),
    KnownLoop(process=PureDelay(K=1e6, theta=9.0), controller=PID(Kc=1e-9)),
    KnownLoop(process=TransferFunction((1.0,), (9.0, -1.0)), controller=PID(Kc=2.0, Ti=1e9)),
    KnownLoop(
        process=SOPDT(K=1e-9, tau1=9.0, tau2=1e-3, theta=0.0),
        controller=PID(Kc=1e9, Ti=1e-3, Td=1e6, action=Action_.DIRECT),
        limits=OutputLimits(low=-1.0, high=1.0, rate=0.1),
    ),
]


# Shrinking seven hundred samples would take longer than the whole suite.
@settings(max_examples=60, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))
@given(st.data())
def test_no_data_make_an_exception_or_a_number_that_is_none(data: st.DataObject) -> None:
    n = data.draw(st.sampled_from([1, 3, 31, 64, 150, 700]))
    signals = arrays(np.float64, n, elements=VALUES)
    mode = arrays(np.int8, n, elements=st.sampled_from([-1, 0, 1, 2, 3]))
    found = assess_signals(
        np.arange(n) * data.draw(st.sampled_from([0.1, 1.0, 60.0])),
        data.draw(signals),
        data.draw(signals),
        sp=data.draw(st.none() | signals),
        mode=data.draw(st.none() | mode),
        kind=data.draw(st.sampled_from(["flow", "level", "averaging_level"])),
        pv_range=data.draw(st.none() | st.just((-1e6, 1e6))),
        op_range=(-1e6, 1e6),
        delay=data.draw(st.none() | st.just(3.0)),
        known=data.draw(st.none() | st.sampled_from(SHEETS)),
        tau_c=data.draw(st.none() | st.sampled_from([1e-9, 20.0, 1e9])),
    )
    json.dumps(assessment_body(found), allow_nan=False)
    assert found.grade.points is None or 0 <= found.grade.points <= 100
