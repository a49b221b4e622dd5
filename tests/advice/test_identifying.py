"""The way a record goes to its model: open-loop test or routine data."""

import numpy as np
import pytest

from advice.case_body import case_body
from advice.identifying import identified
from advice.tune import tune
from identification.verdict import Verdict
from loop.controller import PID
from loop.plants import PLANT, relay_test, routine_operation, step_test
from loop.process import FOPDT
from loop.record import Mode, Record
from loop.simulation import simulate

PROCESS = FOPDT(K=2.0, tau=60.0, theta=10.0)


def routine(*, mode: bool = True) -> Record:
    """An hour in automatic with two set-point moves."""
    t = np.arange(3600.0)
    sp = 50.0 + 5.0 * (t > 900) - 5.0 * (t > 2400)
    run = simulate(
        PROCESS, PID(Kc=1.0, Ti=60.0), t_end=3599.5, dt=1.0, sp=sp, noise=0.1,
        rng=np.random.default_rng(4), pv0=50.0, op0=40.0,
    )  # fmt: skip
    return Record(
        t=run.t, sp=run.sp, pv=run.pv, op=run.op,
        mode=np.full(t.size, Mode.AUTO, dtype=np.int8) if mode else None,
    )  # fmt: skip


@pytest.mark.parametrize("mode", [True, False])
def test_routine_data_are_tuned_like_a_step_test(mode: bool) -> None:
    case = tune(routine(mode=mode))
    assert case.best is not None
    assert case.model is not None
    assert case.model.verdict is Verdict.TRUSTED
    assert isinstance(case.process, FOPDT)
    assert case.process.theta == pytest.approx(10.0, abs=0.5)
    body = case_body(case)
    assert isinstance(body["model"], dict)
    assert body["model"]["kind"] == "FOPDT"
    assert body["recommended"] is not None


def test_a_step_in_manual_stays_an_open_loop_test() -> None:
    assert len(identified(step_test(PLANT[3])).steps) == 4


def test_a_day_without_a_set_point_move_is_refused_for_want_of_one() -> None:
    record = routine_operation(PLANT[3], duration=3600.0)
    still = Record(
        t=record.t, sp=np.full(len(record), 160.0), pv=record.pv, op=record.op, mode=record.mode
    )
    assert "the set point stood still" in identified(still).reasons[0]


def test_a_set_point_that_only_follows_pv_is_no_move() -> None:
    record = step_test(PLANT[3])
    following = Record(t=record.t, sp=record.pv, pv=record.pv, op=record.op)
    assert len(identified(following).steps) == 4
    alone = Record(t=record.t, pv=record.pv, op=record.op)
    assert len(identified(alone).steps) == 4
    single = Record(t=[0.0], sp=[1.0], pv=[1.0], op=[1.0])
    assert identified(single).verdict is Verdict.REFUSED


def test_routine_data_also_show_the_settings_that_run() -> None:
    case = tune(routine())
    assert case.as_found is not None
    assert case.running is not None
    assert (case.running.Kc, case.running.Ti) == pytest.approx((1.0, 60.0), rel=1e-6)
    assert case.running_verification is not None
    assert case.running_verification.stable
    found = case_body(case)["as_found"]
    assert isinstance(found, dict)
    assert found["verdict"] == "trusted"
    assert found["settings"] is not None


def test_stated_settings_are_taken_at_their_word() -> None:
    case = tune(routine(), running=PID(Kc=0.5, Ti=100.0))
    assert case.as_found is None
    assert case.running is not None
    assert case.running.Kc == 0.5
    assert tune(step_test(PLANT[3])).as_found is None


def test_a_relay_test_is_known_by_its_switching_whatever_the_mode() -> None:
    loop = PLANT[3]
    found = identified(relay_test(loop))
    assert isinstance(found.process, FOPDT)
    assert isinstance(loop.process, FOPDT)
    assert found.process.theta == pytest.approx(loop.process.theta, rel=0.02)
