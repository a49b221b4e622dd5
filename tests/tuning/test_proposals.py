"""All rules at once: nothing is lost, refusals are answers."""

import pytest

from loop.controller import Action
from loop.process import FOPDT, IPDT, DoubleIntegrator
from tuning.catalogue import RULES
from tuning.proposals import propose, tune_all, tune_from_ultimate
from tuning.ultimate import UltimatePoint, ultimate_point

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def test_every_structure_of_every_rule_answers_once() -> None:
    columns = [(rule.name, structure) for rule in RULES.values() for structure in rule.structures]
    for process in (HEATER, IPDT(K=0.1, theta=5.0), DoubleIntegrator(K=0.1, theta=5.0)):
        found = tune_all(process)
        assert [(p.rule, p.structure) for p in found] == columns
        assert all((p.pid is None) != (p.refusal is None) for p in found)


def test_a_refusal_names_the_rule_and_the_reason() -> None:
    refused = {p.rule: p.refusal for p in tune_all(DoubleIntegrator(K=0.1, theta=5.0)) if not p.pid}
    assert refused["cohen_coon"] == (
        "Cohen-Coon does not apply: it takes FOPDT, not DoubleIntegrator."
    )


def test_the_speed_in_use_is_told_with_its_reason() -> None:
    default = {(p.rule, p.structure): p for p in tune_all(HEATER)}
    assert default["simc", "PI"].tau_c == 30.0
    assert default["simc", "PI"].tau_c_reason == "default: theta"
    assert default["lambda_pi", "PI"].tau_c == 120.0
    assert default["cohen_coon", "PI"].tau_c is None
    assert default["cohen_coon", "PI"].tau_c_reason is None


def test_a_chosen_speed_reaches_only_the_rules_that_have_one() -> None:
    chosen = {(p.rule, p.structure): p for p in tune_all(HEATER, tau_c=60.0)}
    default = {(p.rule, p.structure): p for p in tune_all(HEATER)}
    assert chosen["simc", "PI"].tau_c == 60.0
    assert chosen["simc", "PI"].tau_c_reason == "as chosen"
    assert chosen["simc", "PI"].pid != default["simc", "PI"].pid
    assert chosen["cohen_coon", "PID"] == default["cohen_coon", "PID"]
    with pytest.raises(ValueError, match="tau_c"):
        tune_all(HEATER, tau_c=-1.0)


def test_settings_from_memory_say_so() -> None:
    found = {p.rule: p for p in tune_all(IPDT(K=0.1, theta=5.0)) if p.pid}
    assert found["lambda_integrating_pi"].status == "memory"
    assert "from memory" in found["lambda_integrating_pi"].notes[-1]
    assert not any("cited from memory" in note for note in found["simc"].notes)


def test_settings_no_controller_takes_are_refused_in_words() -> None:
    refused = propose(FOPDT(K=1e9, tau=1.0, theta=10.0), RULES["simc"], "PI")
    assert refused.pid is None
    assert "Kc must lie within" in (refused.refusal or "")


def test_a_relay_test_feeds_the_rules_of_ku_and_pu() -> None:
    """Second route: the exact point through the relay's door gives the model's settings."""
    exact = ultimate_point(HEATER)
    by_model = {(p.rule, p.structure): p.pid for p in tune_all(HEATER)}
    found = tune_from_ultimate(exact)
    assert {p.rule for p in found} == {"ziegler_nichols_ultimate", "tyreus_luyben"}
    assert all(by_model[p.rule, p.structure] == p.pid for p in found)
    assert all("exact" in p.notes[0] for p in found)

    relay = tune_from_ultimate(UltimatePoint(Ku=2.0, Pu=60.0, action=Action.DIRECT))
    assert all("describing function" in p.notes[0] for p in relay)
    assert all(p.pid is not None and p.pid.action is Action.DIRECT for p in relay)
