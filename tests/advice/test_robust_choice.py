"""Proofs and optimal settings of a case, as bodies and as sentences."""

import json

from advice.robust_body import optimal_body, optimal_words, proof_body, proof_words
from advice.robust_choice import optimal_choices, prove_case
from advice.tune import tune, tune_process
from loop.controller import PID
from loop.margins import margins
from loop.process import FOPDT
from loop.record import Record

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def test_the_recommended_and_the_running_settings_are_proven() -> None:
    case = tune_process(HEATER, running=PID(Kc=1.6, Ti=120.0))
    proof = prove_case(case)
    assert proof is not None
    assert [proven.name for proven in proof.settings] == ["recommended", "running"]
    best, running = proof.settings
    assert case.best is not None
    assert best.pid == case.best.proposal.pid
    assert running.proof.stable is False
    assert proof.joint_tau_c is not None
    assert proof.joint_tau_c.tau_c > proof.joint_tau_c.alone
    words = " ".join(proof_words(proof))
    assert "The recommended settings: worst over ±50 %" in words
    assert "not every plant" in words
    assert "SIMC is proven with all parameters off" in words
    body = json.loads(json.dumps(proof_body(proof), allow_nan=False))
    assert body["settings"][0]["worst"]["Ms"]["bound"] == best.proof.worst["Ms"].bound
    assert body["settings"][1]["worst"]["Ms"]["found"] is None
    assert body["settings"][1]["unstable_plant"]["kind"] == "FOPDT"
    assert body["settings"][0]["largest_box"]["holds"] == best.largest.holds


def test_settings_from_data_are_optimal_over_the_box_and_over_the_draws(
    heater_test: Record, heater: FOPDT
) -> None:
    case = tune(heater_test)
    choices = optimal_choices(case)
    assert choices is not None
    assert [choice.structure for choice in choices] == ["PI", "PID"]
    for choice in choices:
        assert choice.over_box is not None
        assert choice.over_draws is not None
        assert choice.front is not None
        assert choice.over_box.verdict.holds
        # What the record leaves open is far less than ±50 %.
        assert choice.over_draws.settings.load_IAE < choice.over_box.settings.load_IAE
        assert margins(heater, choice.over_draws.settings.pid).Ms < case.profile.Ms * 1.02
    words = " ".join(optimal_words(choices))
    assert "Optimal PI over ±50 % of all parameters at once (proven)" in words
    assert "draws, a probability of at least" in words
    assert "from calm to fast" in words
    body = json.loads(json.dumps(optimal_body(choices), allow_nan=False))
    assert body[0]["over_box"]["proven"] is True
    assert body[1]["over_draws"]["probability"] >= 0.95
    assert [round(point["margins"]["Ms"], 2) for point in body[0]["front"]] == [
        1.2, 1.4, 1.6, 1.8, 2.0,
    ]  # fmt: skip


def test_a_stated_process_has_no_draws_and_without_dead_time_there_is_a_reason() -> None:
    plain = tune_process(FOPDT(K=2.0, tau=120.0, theta=0.0), tau_c=50.0)
    choices = optimal_choices(plain)
    assert choices is not None
    assert choices[0].over_draws is None
    assert choices[0].over_box is None
    assert "bound the gain" in choices[0].refusals[0]
    assert any("bound the gain" in text for text in optimal_words(choices))
    assert json.dumps(optimal_body(choices), allow_nan=False)
    proof = prove_case(plain)
    assert proof is not None
    assert proof.joint_tau_c is None
    assert proof.joint_refusal in proof_words(proof)
    assert proof_body(proof)["joint_tau_c"] is None


def test_without_a_model_there_is_nothing_to_prove(flat_record: Record) -> None:
    case = tune(flat_record)
    assert prove_case(case) is None
    assert optimal_choices(case) is None
