"""The recommendation: passing, integral, confirmed, least load area, PI before a PID in vain."""

import math
from dataclasses import replace

import numpy as np
import pytest

from loop.controller import PID
from loop.process import FOPDT, IPDT
from loop.simulation import simulate
from tuning.profiles import PROFILES, Profile
from tuning.proposals import Proposal
from tuning.ranking import load_area, recommend
from tuning.verification import Verification, verify_many

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)
GENERAL = PROFILES["general"]


def proposal(pid: PID | None, *, rule: str = "simc", memory: bool = False) -> Proposal:
    return Proposal(
        rule=rule,
        structure=pid.structure if pid else "PI",
        pid=pid,
        refusal=None if pid else "it refuses.",
        status="memory" if memory else "confirmed",
    )


def verified(proposals: list[Proposal], profile: Profile = GENERAL) -> list[Verification | None]:
    found = iter(verify_many(HEATER, [p.pid for p in proposals if p.pid], profile))
    return [next(found) if p.pid else None for p in proposals]


SLOW, FAST = PID(Kc=0.4, Ti=120.0), PID(Kc=0.8, Ti=120.0)
TOO_FAST = PID(Kc=1.6, Ti=60.0)


def test_the_area_is_the_integral_of_the_simulated_deviation() -> None:
    """Second route: simulation of a load step, for a loop that does not cross its set point."""
    response = simulate(HEATER, SLOW, t_end=6000.0, dt=1.0, load=1.0)
    assert float(np.sum(response.true_pv)) == pytest.approx(load_area(SLOW), rel=1e-3)
    assert float(np.sum(np.abs(response.true_pv))) == pytest.approx(load_area(SLOW), rel=1e-3)
    assert load_area(PID(Kc=1.0)) == math.inf


def test_the_fastest_that_passes_is_recommended_with_its_numbers() -> None:
    proposals = [proposal(None), proposal(SLOW), proposal(TOO_FAST), proposal(FAST)]
    found = recommend(proposals, verified(proposals))
    assert found.index == 3
    assert "passes the general profile for ±50 % of each parameter" in found.reason
    assert "of the 2 settings that do" in found.reason
    assert "Ti/Kc = 150 s PV/OP" in found.reason
    assert "with tau x 0.5" in found.reason
    assert found.reason.endswith(".")


def test_the_only_one_that_passes_is_named_so() -> None:
    proposals = [proposal(TOO_FAST), proposal(SLOW)]
    assert "no other settings do" in recommend(proposals, verified(proposals)).reason


@pytest.mark.parametrize(
    ("Ti", "structure", "words"),
    [
        (100.0, "PI", "would save 17%"),
        (90.0, "PID", "saves 25% against SIMC PI"),
    ],
)
def test_a_pid_must_save_a_fifth(Ti: float, structure: str, words: str) -> None:
    plain = PID(Kc=0.5, Ti=120.0)
    rich = PID(Kc=0.5, Ti=Ti, Td=5.0)
    proposals = [proposal(plain), proposal(rich, rule="imc_pid")]
    found = recommend(proposals, verified(proposals))
    assert found.index is not None
    chosen = proposals[found.index].pid
    assert chosen is not None
    assert chosen.structure == structure
    assert words in found.reason


def test_a_pid_slower_than_the_pi_is_not_mentioned() -> None:
    proposals = [proposal(FAST), proposal(PID(Kc=0.3, Ti=135.0, Td=13.0), rule="imc_pid")]
    found = recommend(proposals, verified(proposals))
    assert found.index == 0
    assert "IMC PID" not in found.reason


def test_a_pid_alone_is_recommended() -> None:
    proposals = [proposal(PID(Kc=0.3, Ti=135.0, Td=13.0), rule="imc_pid")]
    assert recommend(proposals, verified(proposals)).index == 0


def test_a_rule_from_memory_waits_behind_the_confirmed_ones() -> None:
    proposals = [proposal(FAST, memory=True), proposal(SLOW)]
    assert recommend(proposals, verified(proposals)).index == 1

    alone = [proposal(FAST, memory=True), proposal(TOO_FAST)]
    found = recommend(alone, verified(alone))
    assert found.index == 0
    assert "from memory, check it before use" in found.reason


def test_settings_that_leave_an_offset_are_not_recommended() -> None:
    proposals = [proposal(PID(Kc=0.8)), proposal(TOO_FAST)]
    found = recommend(proposals, verified(proposals))
    assert found.index is None
    assert "leave an offset" in found.reason


def test_when_nothing_passes_the_closest_and_what_it_misses_are_told() -> None:
    proposals = [proposal(TOO_FAST), proposal(PID(Kc=1.0, Ti=120.0)), proposal(None)]
    found = recommend(proposals, verified(proposals))
    assert found.index is None
    assert found.reason.startswith("No settings pass the general profile")
    assert "The closest is SIMC PI: Ms is 2.121" in found.reason


def test_when_every_rule_refuses_that_is_the_reason() -> None:
    found = recommend([proposal(None)], [None])
    assert found.index is None
    assert "No rule has settings" in found.reason


def test_the_speed_in_use_is_part_of_the_name() -> None:
    told = replace(proposal(SLOW), tau_c=120.0, tau_c_reason="as chosen")
    assert "SIMC PI at tau_c = 120 s (as chosen)" in recommend([told], verified([told])).reason


def test_proposals_and_verifications_must_pair() -> None:
    with pytest.raises(ValueError, match="1 proposals need as many verifications, got 0"):
        recommend([proposal(SLOW)], [])


def test_the_reason_is_filled_for_an_integrator_too() -> None:
    process = IPDT(K=0.5, theta=2.0)
    pid = PID(Kc=0.3, Ti=30.0)
    found = recommend([proposal(pid)], list(verify_many(process, [pid], GENERAL)))
    assert found.index == 0
