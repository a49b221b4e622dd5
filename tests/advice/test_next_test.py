"""The test to run next after one that was refused, run and accepted."""

import json

import numpy as np
import pytest

from advice.case_body import case_body
from advice.next_test import (
    NextTest,
    after,
    next_test,
    next_test_body,
    next_test_sentences,
)
from advice.planning import plan_body, plan_sentences, plan_test
from advice.report.page import report_page
from advice.tune import tune
from identification.identify import identify
from identification.planner import StepPlan, Wishes
from identification.pulse_planner import PulsePlan
from loop.open_loop import process_output
from loop.process import FOPDT, IPDT, SOPDT
from loop.record import Record

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def run(plan: StepPlan, noise: float) -> Record:
    t = np.arange(0.0, plan.duration, plan.sample_time)
    op = np.append(0.0, plan.levels)[np.searchsorted(plan.times, t, side="right")]
    pv = process_output(HEATER, t, op)
    return Record(t=t, pv=pv + np.random.default_rng(3).normal(0, noise, t.size), op=op)


@pytest.fixture
def weak_test() -> Record:
    """A step far too small for the noise, and too short."""
    t = np.arange(0.0, 400.0, 2.0)
    op = np.where(t < 100, 40.0, 42.0)
    noise = np.random.default_rng(1).normal(0, 1.5, t.size)
    return Record(t=t, pv=process_output(HEATER, t, op) + noise, op=op)


def test_the_test_that_is_proposed_after_a_refusal_is_accepted(weak_test: Record) -> None:
    case = tune(weak_test)
    assert case.process is None
    following = after(case)
    assert following is not None
    assert following.plan is not None
    assert following.noise == pytest.approx(1.5, rel=0.2)
    again = tune(run(following.plan, 1.5))
    assert again.best is not None
    assert after(again) is None


def test_the_proposal_is_in_the_document_and_the_report(weak_test: Record) -> None:
    case = tune(weak_test)
    body = json.loads(json.dumps(case_body(case), allow_nan=False))
    assert body["next_test"]["plan"]["kind"] == "steps"
    assert body["next_test"]["guess"]["kind"] == "FOPDT"
    page = report_page(case, title="weak")
    assert "The test to run next" in page
    assert "In manual, with PV at rest, record" in page
    good = tune(run(plan_steps_for(HEATER), 0.1))
    assert case_body(good)["next_test"] is None
    assert "The test to run next" not in report_page(good, title="good")


def plan_steps_for(process: FOPDT) -> StepPlan:
    plan = plan_test(Wishes(guess=process, noise=0.1, deviation=5.0))
    assert isinstance(plan, StepPlan)
    return plan


def test_a_record_that_says_nothing_of_the_speed_is_taken_for_six_time_constants() -> None:
    t = np.arange(0.0, 600.0)
    rng = np.random.default_rng(0)
    record = Record(t=t, pv=rng.normal(0, 1.0, 600), op=np.where(t < 100, 0.0, 3.0))
    # No answer to the move: whatever was fitted is no guess.
    found = next_test(record, IPDT(K=1.0, theta=1.0), None)
    assert isinstance(found.guess, FOPDT)
    assert found.guess.tau == pytest.approx(100.0, rel=0.01)
    assert found.noise == pytest.approx(1.0, rel=0.15)
    assert "a sixth of the record" in found.reason
    assert found.plan is not None
    # A gain far beyond what PV did cannot be meant either.
    absurd = next_test(record, FOPDT(K=500.0, tau=100.0, theta=10.0), 1.0)
    assert absurd.guess == found.guess


def test_after_a_refused_integrator_pulses_are_planned_that_carry_a_model() -> None:
    level = IPDT(K=0.01, theta=20.0)
    t = np.arange(0.0, 900.0, 2.0)
    op = np.where((t > 300) & (t < 420), 51.0, 50.0)
    noise = np.random.default_rng(5).normal(0, 1.0, t.size)
    refused = Record(t=t, pv=process_output(level, t, op) + noise, op=op)

    following = next_test(refused, IPDT(K=0.014, theta=15.0), 1.0)

    plan = following.plan
    assert isinstance(plan, PulsePlan)
    body = next_test_body(following)
    assert body["guess"] == {"kind": "IPDT", "K": 0.014, "theta": 15.0}
    assert len(next_test_sentences(following)) > 3
    t = np.arange(0.0, plan.duration, plan.sample_time)
    op = np.append(0.0, plan.levels)[np.searchsorted(plan.times, t, side="right")]
    noise = np.random.default_rng(6).normal(0, 1.0, t.size)
    found = identify(Record(t=t, pv=process_output(level, t, op) + noise, op=op))
    assert isinstance(found.process, IPDT)
    assert abs(found.process.K / level.K - 1) < 0.15


def test_an_integrator_whose_numbers_cannot_be_meant_is_no_guess(weak_test: Record) -> None:
    for fitted in (IPDT(K=1e3, theta=10.0), IPDT(K=0.01, theta=1e6)):
        assert isinstance(next_test(weak_test, fitted, 1.5).guess, FOPDT)


def test_two_lags_are_guessed_as_one() -> None:
    t = np.arange(0.0, 600.0)
    record = Record(t=t, pv=np.where(t < 300, 0.0, 2.0), op=np.where(t < 200, 0.0, 1.0))
    found = next_test(record, SOPDT(K=2.0, tau1=40.0, tau2=10.0, theta=5.0), 0.1)
    assert found.guess == FOPDT(K=2.0, tau=45.0, theta=10.0)


def test_without_a_move_the_proposal_says_how_far_pv_is_to_go() -> None:
    t = np.arange(0.0, 300.0)
    noise = np.random.default_rng(0).normal(0, 0.1, 300)
    found = next_test(Record(t=t, pv=noise, op=np.full(300, 5.0)), None, None)
    assert found.plan is None
    assert "OP did not move" in next_test_sentences(found)[0]
    assert "1.0 (ten times its noise)" in found.reason


@pytest.mark.parametrize("pv", [np.full(30, 7.0), np.full(30, np.nan)])
def test_a_dead_reading_is_to_be_repaired_first(pv: np.ndarray) -> None:
    found: NextTest = next_test(Record(t=np.arange(30.0), pv=pv, op=np.arange(30.0)), None, None)
    assert found.noise is None
    assert "check the tag" in found.reason


def test_a_relay_plan_says_levels_period_and_limits() -> None:
    plan = plan_test(Wishes(guess=HEATER, noise=0.1, deviation=5.0), "relay")
    text = " ".join(plan_sentences(plan))
    assert "let a relay switch OP between" in text
    assert "OP has not switched for" in text
    body = json.loads(json.dumps(plan_body(plan), allow_nan=False))
    assert body["kind"] == "relay"
    assert len(body["expected_errors"]) == 3
    assert body["instructions"] == plan_sentences(plan)
