"""Settings for a process that swings by itself, held to its damping."""

import math

import numpy as np
import pytest

from advice.case_body import case_body
from advice.report.page import report_page
from advice.tune import tune
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.margins import margins
from loop.open_loop import process_output
from loop.process import FOPDT, Process, TransferFunction
from loop.record import Record
from loop.swing import swing_of
from tuning.profiles import PROFILES
from tuning.swinging import swing_sweep, verify_swing

GENERAL = PROFILES["general"]


def swinging(zeta: float, theta: float = 5.0, T: float = 10.0) -> Process:
    return TransferFunction((2.0,), (T**2, 2 * zeta * T, 1.0), theta)


def test_a_swing_is_read_from_its_transfer_function_alone() -> None:
    swing = swing_of(TransferFunction((4.0,), (200.0, 12.0, 2.0), 5.0))
    assert swing is not None
    assert (swing.K, swing.T, swing.zeta, swing.theta) == pytest.approx((2.0, 10.0, 0.3, 5.0))
    assert swing.process == swinging(0.3)
    for other in (
        FOPDT(K=2.0, tau=10.0, theta=5.0),
        TransferFunction((2.0,), (100.0, 25.0, 1.0), 5.0),  # two real lags
        TransferFunction((2.0,), (100.0, -3.0, 1.0), 5.0),  # unstable
        TransferFunction((1.0, 2.0), (100.0, 3.0, 1.0), 5.0),
    ):
        assert swing_of(other) is None


def test_the_verdict_rests_on_margins_at_every_plant_of_the_sweep() -> None:
    swing = swing_of(swinging(0.3))
    assert swing is not None
    pid = PID(Kc=0.02, Ti=6.0)
    (found,) = verify_swing(swing, [pid], GENERAL)
    sweep, plants = swing_sweep(swing)
    assert sweep.parameters == ("K", "T", "zeta", "theta")
    peaks = []
    for plant in plants[: 1 + 4 * 11]:
        try:
            peaks.append(margins(plant.process, pid).Ms)
        except UnstableLoop:
            peaks.append(math.inf)
    assert found.worst["Ms"].value == pytest.approx(max(peaks))
    assert found.nominal.Ms == pytest.approx(peaks[0])
    assert found.worst["Ms"].where == sweep.where[int(np.argmax(peaks))]


def test_settings_from_a_step_test_hold_with_half_the_damping() -> None:
    t = np.arange(0.0, 900.0, 2.0)
    op = np.where((t < 60) | (t > 480), 40.0, 45.0)
    truth = swinging(0.3)
    pv = process_output(truth, t, op, pv0=50.0) + np.random.default_rng(1).normal(0, 0.1, t.size)
    case = tune(Record(t=t, pv=pv, op=op), running=PID(Kc=2.0, Ti=5.0))
    best = case.best
    assert best is not None
    assert best.proposal.pid is not None
    assert best.verification is not None
    assert best.proposal.rule == "least_area"
    assert best.passes
    assert best.verification.corners_pass
    for zeta in (0.15, 0.3, 0.45):
        assert margins(swinging(zeta), best.proposal.pid).Ms <= GENERAL.Ms
    assert case.running_verification is not None
    assert not case.running_verification.stable
    refused = [t.proposal.refusal for t in case.tunings if t.proposal.pid is None]
    assert any("swings by itself (damping 0.3" in str(text) for text in refused)
    assert "Least load area" in case.recommended_reason
    stated = case_body(case)["recommended"]
    assert isinstance(stated, dict)
    assert stated["source"] == "computed, not published"
    assert "Least load area" in report_page(case, title="FIC-1")
