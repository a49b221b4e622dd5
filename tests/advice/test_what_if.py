"""Settings simulated before they are typed: events, conditions, fan and replay."""

import json
import math
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest

from advice.fan import Fan, box_draws, uncertain_processes
from advice.scenario import Conditions, LoadChange, Replay, SetPointChange, Transfer
from advice.what_if import ErrorMeasures, Run, WhatIf, what_if
from advice.what_if_body import what_if_body
from loop.controller import PID, Action
from loop.digital_pid import AntiWindup, OutputLimits
from loop.disturbances import coloured_noise
from loop.experiment import Step
from loop.measures import LoadMeasures, StepMeasures, load_measures, step_measures
from loop.process import FOPDT, IPDT, SOPDT, TransferFunction
from loop.record import Record
from loop.recorded_disturbance import recorded_disturbance
from loop.simulation import Response, simulate
from loop.valve import Choudhury
from tuning.output_movement import output_movement

HEATER = FOPDT(K=2, tau=120, theta=30)
NEW, NOW = PID(Kc=0.9, Ti=135, Td=13.3), PID(Kc=0.4, Ti=200)


def only(found: WhatIf, event: int = 0, run: int = 0) -> Run:
    return found.answers[event].runs[run]


def response_of(run: Run) -> Response:
    assert run.response is not None
    return run.response


def stepped(run: Run) -> StepMeasures:
    assert isinstance(run.measures, StepMeasures)
    return run.measures


def errors(run: Run) -> ErrorMeasures:
    assert isinstance(run.measures, ErrorMeasures)
    return run.measures


def fan_in(run: Run) -> Fan:
    assert run.fan is not None
    return run.fan


def test_each_controller_meets_each_event_under_the_same_conditions() -> None:
    conditions = Conditions(
        scan_time=2.0,
        t_end=900.0,
        limits=OutputLimits(low=0, high=60, rate=1.0),
        anti_windup=AntiWindup.CLAMPING,
        pv_filter=5.0,
        resolution=0.02,
        valve=Choudhury(S=0.5, J=0.2),
        pv0=150.0,
        op0=40.0,
    )
    found = what_if(
        HEATER,
        {"new": NEW, "now": NOW},
        [SetPointChange(size=5.0), LoadChange(size=2.0)],
        conditions=conditions,
    )
    shared = {
        "t_end": 900,
        "dt": 2,
        "limits": conditions.limits,
        "anti_windup": AntiWindup.CLAMPING,
        "pv_filter": 5.0,
        "resolution": 0.02,
        "valve": conditions.valve,
        "pv0": 150.0,
        "op0": 40.0,
    }
    for i, (name, pid) in enumerate((("new", NEW), ("now", NOW))):
        step = simulate(HEATER, pid, sp=155.0, **shared)
        load = simulate(HEATER, pid, load=2.0, sp=150.0, **shared)
        run, other = only(found, 0, i), only(found, 1, i)
        assert run.name == name
        np.testing.assert_array_equal(response_of(run).pv, step.pv)
        np.testing.assert_array_equal(response_of(other).position, load.position)
        assert run.measures == step_measures(
            step.t, step.true_pv, step.op, sp=155.0, pv0=150.0, op_before=40.0
        )
        assert other.measures == load_measures(
            load.t, load.true_pv, load.op, sp=150.0, op_before=40.0
        )
    assert isinstance(only(found).measures, StepMeasures)
    assert isinstance(only(found, 1).measures, LoadMeasures)


def test_the_effort_counts_moves_turns_and_limits() -> None:
    limits = OutputLimits(low=-9, high=1.0)
    run = only(
        what_if(
            HEATER,
            {"new": PID(Kc=1.5, Ti=135)},
            [SetPointChange(size=1.9)],
            conditions=Conditions(scan_time=1.0, limits=limits),
        )
    )
    op, effort = response_of(run).op, run.effort
    assert effort is not None
    assert effort.at_limit == np.mean(op >= 1) > 0.01
    assert effort.travel == pytest.approx(np.abs(np.diff(op, prepend=0.0)).sum())
    assert effort.largest_move == 1.0
    up_and_down = np.diff(np.sign(np.diff(op, prepend=0.0)[np.diff(op, prepend=0.0) != 0]))
    assert effort.reversals == np.count_nonzero(up_and_down)


def test_noise_is_the_same_for_every_controller_and_not_in_the_measures() -> None:
    conditions = Conditions(scan_time=2.0, noise=0.3, seed=4)
    found = what_if(HEATER, {"a": NEW, "b": NEW}, [SetPointChange(size=5.0)], conditions=conditions)
    a, b = found.answers[0].runs
    heard = response_of(a)
    np.testing.assert_array_equal(heard.pv, response_of(b).pv)
    assert np.std(heard.pv - heard.true_pv) == pytest.approx(0.3, rel=0.1)
    assert stepped(a).overshoot < 15


def test_the_noise_has_its_price_in_travel_of_the_output() -> None:
    wild = PID(Kc=9, Ti=100)
    conditions = Conditions(scan_time=2.0, t_end=60_000.0, noise=0.3, pv_filter=4.0)
    found = what_if(HEATER, {"new": NEW, "wild": wild}, [Transfer()], conditions=conditions)
    assert found.movements == {
        "new": output_movement(HEATER, NEW, scan_time=2, noise=0.3, pv_filter=4)
    }
    assert what_if(HEATER, {"new": NEW}, [Transfer()]).movements == {}
    noisy = what_if(HEATER, {"new": NEW}, [LoadChange(size=1e-9)], conditions=conditions)
    effort = only(noisy).effort
    assert effort is not None
    a_day = effort.travel * 86_400 / 60_000
    assert a_day == pytest.approx(found.movements["new"].travel, rel=0.03)


def test_a_ramp_overshoots_less_than_a_step() -> None:
    quick = PID(Kc=1.4, Ti=110)
    found = what_if(
        HEATER, {"q": quick}, [SetPointChange(size=-4.0), SetPointChange(size=-4, rate=0.01)]
    )
    step, ramp = (answer.runs[0] for answer in found.answers)
    assert stepped(ramp).overshoot < 0.5 * stepped(step).overshoot
    whole = only(what_if(HEATER, {"q": quick}, [SetPointChange(size=600, rate=1)]))
    np.testing.assert_allclose(response_of(whole).sp[:3], response_of(whole).t[:3])
    course = response_of(ramp)
    at = np.searchsorted(course.t, 100.0)
    assert course.sp[at] == pytest.approx(-0.01 * course.t[at])


@pytest.mark.parametrize("size", [0.0, 3.0, -1.0])
@pytest.mark.parametrize("pid", [NEW, PID(Kc=0.4, Ti=200, tauF=20), PID(Kc=0.7)])
def test_the_transfer_to_automatic_bumps_by_less_than_a_billionth(pid: PID, size: float) -> None:
    run = only(what_if(HEATER, {"new": pid}, [Transfer(size=size)], conditions=Conditions(op0=40)))
    assert run.bump is not None
    assert run.bump < 1e-9
    assert errors(run).largest == pytest.approx(abs(size), abs=0.02)
    course = response_of(run)
    assert np.all(course.op[course.t < 0.1 * course.t[-1]] == 40)


def routine(pid: PID, process: FOPDT = HEATER) -> Record:
    """A loop in automatic with a wandering load, a jump of it, noise and a set-point move."""
    rng, dt = np.random.default_rng(6), 5.0
    t = np.arange(721) * dt
    load = coloured_noise(t, memory=400, size=0.8, rng=rng) + np.where(t > 1500, 3.0, 0.0)
    run = simulate(
        process,
        pid,
        t_end=t[-1],
        dt=dt,
        sp=Step(size=4, at=2500),
        load=load,
        noise=0.1,
        rng=rng,
        limits=OutputLimits(low=0, high=50),
        pv0=150,
        op0=45,
    )
    return Record(t=run.t, pv=run.pv, op=run.op, sp=run.sp, tag="TIC-1")


def test_a_replay_with_the_settings_of_the_record_is_the_record() -> None:
    record = routine(NOW)
    conditions = Conditions(limits=OutputLimits(low=0, high=50))
    found = what_if(
        HEATER, {"now": NOW, "new": NEW}, [Replay(record=record)], conditions=conditions
    )
    now, new = found.answers[0].runs
    np.testing.assert_allclose(response_of(now).pv, record.pv, atol=1e-9)
    np.testing.assert_allclose(response_of(now).op, record.op, atol=1e-9)
    recorded = found.answers[0].recorded_measures
    assert recorded is not None
    assert record.sp is not None
    assert pytest.approx(np.abs(record.sp - record.pv).sum() * 5) == recorded.IAE
    assert pytest.approx(recorded.IAE, rel=1e-9) == errors(now).IAE
    assert errors(new).IAE < 0.6 * recorded.IAE


def test_a_replay_with_other_settings_is_what_the_loop_would_have_done() -> None:
    """Second route: the same loads and noise simulated with those settings, process known.

    The record starts with the other controller's answer to the first noise, which wears off.
    """
    limits = Conditions(limits=OutputLimits(low=0, high=50))
    truth = routine(NEW)
    found = what_if(HEATER, {"new": NEW}, [Replay(record=routine(NOW))], conditions=limits)
    pv = response_of(only(found)).pv
    assert np.max(np.abs(pv - truth.pv)) < 0.1
    np.testing.assert_allclose(pv[360:], truth.pv[360:], atol=1e-6)


def test_the_disturbance_of_a_record_is_the_load_through_the_process() -> None:
    record = routine(NOW)
    found = recorded_disturbance(record, HEATER, dt=5.0)
    assert found.disturbance[0] == 0
    assert found.bridged == 0
    assert np.mean(found.disturbance[-300:]) == pytest.approx(2 * 3, abs=2)
    holes = record.pv.copy()
    holes[50:53] = np.nan
    bridged = recorded_disturbance(replace(record, pv=holes), HEATER, dt=5.0)
    assert bridged.bridged == pytest.approx(20 / 3600)
    finer = recorded_disturbance(record, HEATER, dt=2.5)
    np.testing.assert_allclose(finer.disturbance[::2], found.disturbance, atol=1e-9)


def test_records_that_cannot_be_replayed_are_refused() -> None:
    record = routine(NOW)
    with pytest.raises(ValueError, match="no set point"):
        recorded_disturbance(replace(record, sp=None), HEATER, dt=5.0)
    few = np.where(np.arange(721) < 9, record.pv, np.nan)
    with pytest.raises(ValueError, match="9 samples have set point, PV and OP"):
        recorded_disturbance(replace(record, pv=few), HEATER, dt=5.0)
    gap = np.where((np.arange(721) > 100) & (np.arange(721) < 300), np.nan, record.pv)
    with pytest.raises(ValueError, match="28 % of the record are gaps, more than 10 %"):
        recorded_disturbance(replace(record, pv=gap), HEATER, dt=5.0)
    with pytest.raises(ValueError, match="at most half the record, got 1000000"):
        recorded_disturbance(record, HEATER, dt=1e6)


def test_the_fan_holds_every_process_of_the_set() -> None:
    draws = box_draws(HEATER, 0.3, n=40)
    found = what_if(
        HEATER,
        {"new": NEW},
        [SetPointChange(size=5.0), LoadChange(size=1.0)],
        conditions=Conditions(scan_time=3.0, t_end=900.0, noise=0.5),
        draws=draws,
    )
    assert found.draws == 40
    fan = fan_in(only(found))
    pvs = []
    for K, tau, theta in draws:
        run = simulate(FOPDT(K=K, tau=tau, theta=theta), NEW, t_end=900, dt=3, sp=5.0)
        pvs.append(run.pv)
    np.testing.assert_allclose(fan.least, np.min(pvs, axis=0), atol=1e-9)
    np.testing.assert_allclose(fan.most, np.max(pvs, axis=0), atol=1e-9)
    np.testing.assert_allclose(fan.median, np.median(pvs, axis=0), atol=1e-9)
    assert np.all(fan.low >= fan.least)
    assert np.all(fan.high <= fan.most)
    assert fan.peak[2] == pytest.approx(np.quantile(np.max(np.abs(pvs), axis=1), 0.95))
    assert fan.diverged == 0


def test_the_fan_says_how_many_processes_the_loop_does_not_hold() -> None:
    wild = PID(Kc=2.0, Ti=200)
    draws = np.array([[2, 120, 30], [2, 120, 60], [2, 120, 90.0]])
    events = [LoadChange(size=1.0), Transfer()]
    conditions = Conditions(scan_time=10.0, t_end=60_000.0)
    found = what_if(HEATER, {"wild": wild}, events, conditions=conditions, draws=draws)
    assert fan_in(only(found)).diverged == 2
    assert only(found, 1).fan is None
    hopeless = what_if(HEATER, {"wild": wild}, events[:1], conditions=conditions, draws=draws[1:])
    assert only(hopeless).fan is None


def test_a_loop_without_bound_is_an_answer_in_words() -> None:
    wrong = PID(Kc=1, Ti=100, action=Action.DIRECT)
    run = only(what_if(HEATER, {"wrong": wrong}, [SetPointChange(size=1.0)],
                       conditions=Conditions(scan_time=20.0, t_end=50_000.0)))  # fmt: skip
    assert run.response is None
    assert run.measures is None
    assert "grows without bound" in run.trouble


@pytest.mark.parametrize(
    "process",
    [HEATER, SOPDT(K=-1, tau1=50, tau2=40, theta=0), IPDT(K=0.1, theta=3)],
)
def test_a_box_starts_with_its_corners_and_stays_inside(process: FOPDT | SOPDT | IPDT) -> None:
    draws = box_draws(process, 0.5, n=60)
    middle = np.array(astuple(process))
    corners = 2**middle.size
    assert draws.shape == (60, middle.size)
    if not isinstance(process, SOPDT):
        off = np.divide(draws, middle, where=middle != 0, out=np.ones_like(draws)) - 1
        np.testing.assert_allclose(np.abs(off[:corners][:, middle != 0]), 0.5)
        assert np.max(np.abs(off)) <= 0.5 + 1e-12
    else:
        assert np.all(draws[:, 1] >= draws[:, 2])
    assert uncertain_processes(process, draws).shape == (60,)
    assert np.array_equal(draws, box_draws(process, 0.5, n=60))


def test_what_cannot_be_simulated_is_refused_in_words() -> None:
    step = [SetPointChange(size=1.0)]
    with pytest.raises(ValueError, match="at least one controller and one event"):
        what_if(HEATER, {}, step)
    with pytest.raises(ValueError, match="scan_time must be positive"):
        Conditions(scan_time=0.0)
    with pytest.raises(ValueError, match="1e\\+07 scans, in 1 runs on 1 processes"):
        what_if(HEATER, {"a": NEW}, step, conditions=Conditions(scan_time=0.0001, t_end=1000.0))
    conditions = Conditions(scan_time=0.001, t_end=999.0)
    with pytest.raises(ValueError, match="on 100 processes"):
        what_if(HEATER, {"a": NEW}, step, conditions=conditions, draws=box_draws(HEATER, 0.1))
    with pytest.raises(ValueError, match="draws of FOPDT have 3 columns, K, tau, theta"):
        what_if(HEATER, {"a": NEW}, step, draws=np.ones((4, 2)))
    with pytest.raises(ValueError, match="noise must be 0 or"):
        what_if(HEATER, {"a": NEW}, step, conditions=Conditions(noise=-1.0))
    with pytest.raises(ValueError, match="spread must lie between"):
        box_draws(HEATER, 1.0)
    with pytest.raises(ValueError, match="not a general transfer function"):
        box_draws(TransferFunction((1.0,), (1.0, 1.0)), 0.5)
    with pytest.raises(ValueError, match="number of draws"):
        box_draws(HEATER, 0.5, n=0)
    for impossible in (
        lambda: SetPointChange(size=0.0),
        lambda: SetPointChange(size=1.0, rate=0.0),
        lambda: LoadChange(size=math.nan),
        lambda: Transfer(size=math.inf),
    ):
        with pytest.raises(ValueError, match="must"):
            impossible()


def test_the_document_holds_no_number_that_json_has_not() -> None:
    found = what_if(
        HEATER,
        {"new": NEW, "wild": PID(Kc=9, Ti=100)},
        [
            SetPointChange(size=5.0, rate=0.1),
            LoadChange(size=1.0),
            Transfer(size=1.0),
            Replay(record=routine(NOW)),
        ],
        conditions=Conditions(scan_time=5.0, t_end=20_000.0, valve=Choudhury(S=1, J=0)),
        draws=box_draws(HEATER, 0.2, n=9),
    )
    document = what_if_body(found)
    body: Any = json.loads(json.dumps(document, allow_nan=False))
    assert body == document
    assert [item["event"]["kind"] for item in body["events"]] == [
        "set point",
        "load",
        "transfer",
        "replay",
    ]
    first = body["events"][0]["runs"][0]
    assert len(first["response"]["t"]) <= 602
    assert first["response"]["t"][-1] == found.t_end
    assert first["measures"]["IAE"] == stepped(only(found)).IAE
    assert first["fan"]["quantiles"] == [0.05, 0.5, 0.95]
    assert body["conditions"]["high"] is None
    assert body["conditions"]["valve"] == {"model": "Choudhury", "S": 1, "J": 0}
    assert body["events"][3]["recorded"]["measures"]["IAE"] > 0
    assert "grows without bound" in body["events"][0]["runs"][1]["trouble"]
