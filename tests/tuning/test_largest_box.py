"""The largest box that a profile survives: both sides of the limit, by proof and by plant."""

import pytest

from loop.controller import PID
from loop.process import FOPDT, IPDT, Process, TransferFunction
from tuning.box_proof import prove_box
from tuning.box_verdict import hold_box
from tuning.largest_box import largest_box
from tuning.profiles import PROFILES

GENERAL = PROFILES["general"]
HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


@pytest.mark.parametrize(
    ("process", "controller"),
    [
        (HEATER, PID(Kc=0.6, Ti=120.0)),
        (HEATER, PID(Kc=0.45, Ti=135.0, Td=13.3)),
        (IPDT(K=0.1, theta=5.0), PID(Kc=0.8, Ti=60.0)),
        (TransferFunction((1.0,), (1.0, 3.0, 3.0, 1.0)), PID(Kc=0.5, Ti=2.0)),
    ],
)
def test_inside_the_profile_is_proven_and_a_plant_outside_breaks_it(
    process: Process, controller: PID
) -> None:
    found = largest_box(process, controller, GENERAL)
    assert found.fails is not None
    assert found.plant is not None
    assert 0 < found.fails - found.holds <= 0.005
    inside = prove_box(process, controller, errors=(found.holds,) * 3)
    assert inside.worst["Ms"].found <= GENERAL.Ms
    assert inside.worst["gain"].found >= GENERAL.gain
    assert inside.worst["phase"].found >= GENERAL.phase
    alone = hold_box(found.plant, controller, GENERAL, errors=(0.0, 0.0, 0.0))
    assert alone.holds is False


def test_settings_that_fail_at_the_model_have_no_box() -> None:
    found = largest_box(HEATER, PID(Kc=3.0, Ti=120.0), GENERAL)
    assert (found.holds, found.fails) == (0.0, 0.0)
    assert "not proven at the model" in found.sentence


def test_timid_settings_hold_to_the_end() -> None:
    found = largest_box(HEATER, PID(Kc=0.001, Ti=120.0), GENERAL)
    assert found.fails is None
    assert found.holds == 0.995


def test_without_a_budget_nothing_is_claimed() -> None:
    found = largest_box(HEATER, PID(Kc=0.3, Ti=120.0), GENERAL, most_cells=40)
    assert found.fails is not None
    assert found.plant is None
    assert "undecided within" in found.sentence
    assert found.holds < largest_box(HEATER, PID(Kc=0.3, Ti=120.0), GENERAL).holds
