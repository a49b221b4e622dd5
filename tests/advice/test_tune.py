"""The walk from a record to verified settings."""

import math

import numpy as np
import pytest

from advice.tune import tune, tune_process
from loop.controller import PID, Action
from loop.margins import margins
from loop.plants import PLANT, relay_test, step_test
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator
from loop.record import Record
from tuning.ultimate import ultimate_point
from tuning.verification import verify


def test_the_recommendation_holds_on_the_true_process(heater_test: Record, heater: FOPDT) -> None:
    case = tune(heater_test)

    assert case.best is not None
    pid = case.best.proposal.pid
    assert pid is not None
    assert case.recommended_reason
    assert verify(heater, pid, case.profile).passes
    assert margins(heater, pid).Ms < case.profile.Ms


def test_a_falling_process_gets_the_direct_action(cooler_test: Record) -> None:
    case = tune(cooler_test)

    assert isinstance(case.process, FOPDT)
    assert pytest.approx(-0.5, rel=0.02) == case.process.K
    assert {t.proposal.pid.action for t in case.tunings if t.proposal.pid} == {Action.DIRECT}


def test_a_refused_record_gives_a_case_with_reasons_and_no_settings(flat_record: Record) -> None:
    case = tune(flat_record)

    assert case.refused
    assert case.best is None
    assert "No settings" in case.recommended_reason
    assert case.model is not None
    assert case.model.reasons[0] in case.recommended_reason


def test_the_running_controller_is_held_to_the_same_profile(heater_test: Record) -> None:
    case = tune(heater_test, running=PID(Kc=3.0, Ti=40.0))

    assert case.running_verification is not None
    assert not case.running_verification.passes
    negative = tune_process(FOPDT(K=-2.0, tau=120.0, theta=30.0), running=PID(Kc=0.3, Ti=120.0))
    assert negative.running is not None
    assert negative.running.action is Action.DIRECT
    assert negative.running_verification is not None
    assert negative.running_verification.stable


def test_the_scan_time_costs_margin(heater: FOPDT) -> None:
    fast, slow = tune_process(heater), tune_process(heater, scan_time=30.0)

    found = [c.tunings[0].verification for c in (fast, slow)]
    assert found[0] is not None
    assert found[1] is not None
    assert found[1].nominal.delay == pytest.approx(found[0].nominal.delay - 15.0)


@pytest.mark.parametrize(
    "process",
    [
        FOPDT(K=2.0, tau=120.0, theta=30.0),
        FOPDT(K=2.0, tau=120.0, theta=0.0),
        SOPDT(K=1.0, tau1=20.0, tau2=5.0, theta=3.0),
        IPDT(K=-0.01, theta=10.0),
        DoubleIntegrator(K=0.001, theta=2.0),
    ],
)
def test_every_kind_of_process_gets_an_answer_or_a_reason(
    process: FOPDT | SOPDT | IPDT | DoubleIntegrator,
) -> None:
    case = tune_process(process)

    assert case.recommended_reason
    assert case.tunings
    for tuning in case.tunings:
        assert (tuning.proposal.pid is None) == (tuning.verification is None)
        assert tuning.proposal.pid is not None or tuning.proposal.refusal
    if case.best is not None:
        assert case.best.verification is not None
        assert case.best.verification.passes


def test_a_profile_that_is_not_there_is_named(heater: FOPDT) -> None:
    with pytest.raises(ValueError, match="profile must be one of process, general"):
        tune_process(heater, profile="bold")


def test_a_relay_test_is_tuned_by_the_model_of_its_cycles() -> None:
    loop = next(item for item in PLANT if item.tag == "TIC-201")
    case = tune(relay_test(loop), relay_hysteresis=4 * loop.noise)

    assert case.relay is not None
    assert case.model is case.relay.model
    assert isinstance(case.process, FOPDT)
    assert isinstance(loop.process, FOPDT)
    assert case.process.theta == pytest.approx(loop.process.theta, rel=0.02)
    assert case.relay.ultimate is not None
    true, found = ultimate_point(loop.process), case.relay.ultimate
    assert abs(found.Ku - true.Ku) < 3 * found.Ku_error
    assert abs(case.relay.relay.Ku / true.Ku - 1) > 0.05  # by describing function
    assert case.best is not None
    pid = case.best.proposal.pid
    assert pid is not None
    assert verify(loop.process, pid, case.profile).passes


def test_a_relay_test_of_every_plant_loop_leads_to_settings_that_hold_on_the_true_process() -> None:
    for loop in PLANT:
        case = tune(relay_test(loop, cycles=10), relay_hysteresis=4 * loop.noise)
        assert case.best is not None, (loop.tag, case.recommended_reason)
        pid = case.best.proposal.pid
        assert pid is not None
        assert margins(loop.process, pid).Ms < 2, loop.tag


def test_a_relay_test_without_a_model_gives_ultimate_rules_without_a_recommendation(
    square_wave: Record,
) -> None:
    case = tune(square_wave, running=PID(Kc=0.1, Ti=100.0))

    assert case.relay is not None
    assert case.process is None
    assert case.running is not None
    rules = {t.proposal.rule for t in case.tunings}
    assert {"ziegler_nichols_ultimate", "tyreus_luyben"} <= rules
    assert all(t.verification is None for t in case.tunings)
    assert case.recommended is None
    assert "not switched by a relay" in case.recommended_reason


def test_a_hysteresis_wider_than_the_swing_is_a_case_with_its_reason() -> None:
    case = tune(relay_test(PLANT[3]), relay_hysteresis=100.0)

    assert case.refused
    assert "less than the hysteresis" in case.recommended_reason


def test_every_plant_loop_with_a_lag_is_found_by_its_own_step_test() -> None:
    for loop in PLANT:
        if not isinstance(loop.process, FOPDT):
            continue
        case = tune(step_test(loop))
        assert isinstance(case.process, FOPDT), (loop.tag, case.recommended_reason)
        assert pytest.approx(loop.process.K, rel=0.15) == case.process.K, loop.tag


def test_records_that_say_nothing_never_crash() -> None:
    for values in (
        {"t": [0.0], "pv": [1.0], "op": [1.0]},
        {"t": [0.0, 1.0], "pv": [1.0, 2.0], "op": [1.0, 2.0]},
        {"t": np.arange(50.0), "pv": np.full(50, math.nan), "op": np.arange(50.0)},
        {"t": np.arange(50.0), "pv": np.arange(50.0), "op": np.full(50, math.nan)},
    ):
        case = tune(Record(**values))
        assert case.refused
        assert case.recommended_reason
