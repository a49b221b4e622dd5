"""Settings read from routine data are those that the simulated controller ran with."""

import math

import numpy as np
import pytest

from identification.running_controller import running_controller
from identification.verdict import Verdict
from loop.controller import PID, Action
from loop.digital_pid import OutputLimits
from loop.plants import PLANT, SimulatedLoop, routine_operation
from loop.process import FOPDT
from loop.record import Mode, Record
from loop.signals import Real
from loop.simulation import simulate

HEATER = FOPDT(K=2.0, tau=60.0, theta=10.0)


def run(settings: PID, *, noise: float = 0.1, limits: OutputLimits | None = None) -> Record:
    """Half an hour with two set-point moves."""
    t = np.arange(1800.0)
    found = simulate(
        HEATER, settings, t_end=1799.5, dt=1.0, sp=40.0 + 5.0 * ((t > 200) & (t < 1200)),
        noise=noise, rng=np.random.default_rng(7), limits=limits, pv0=40.0, op0=50.0,
    )  # fmt: skip
    return Record(t=found.t, sp=found.sp, pv=found.pv, op=found.op)


@pytest.mark.parametrize("loop", [loop for loop in PLANT if not loop.controller.tauF])
def test_every_loop_of_the_plant_is_read_exactly(loop: SimulatedLoop) -> None:
    found = running_controller(routine_operation(loop, duration=2000 * loop.scan_time, seed=2))
    assert found.verdict is Verdict.TRUSTED
    assert found.pid is not None
    assert (found.pid.Kc, found.pid.Ti) == pytest.approx(
        (loop.controller.Kc, loop.controller.Ti), rel=1e-9
    )
    assert (found.pid.Td, found.pid.b, found.pid.action) == (0.0, 1.0, loop.controller.action)


def test_derivative_filter_and_lag_are_found_too() -> None:
    loop = PLANT[3]
    found = running_controller(routine_operation(loop, duration=1500 * loop.scan_time, seed=2))
    assert found.pid is not None
    assert found.pid.structure == "PID"
    assert (found.pid.Kc, found.pid.Ti, found.pid.Td) == pytest.approx((0.45, 135, 13.3), rel=5e-3)
    assert found.pid.tauF == pytest.approx(12.0, rel=2e-2)
    assert found.pid.c == 0.0
    assert found.Td is not None


@pytest.mark.parametrize("b", [0.0, 0.4, 1.0])
def test_the_set_point_weight_tells_the_structure(b: float) -> None:
    found = running_controller(run(PID(Kc=1.2, Ti=70.0, b=b)))
    assert found.pid is not None
    assert found.pid.b == pytest.approx(b, abs=1e-9)


def test_a_controller_without_integral_action_is_seen_as_one() -> None:
    found = running_controller(run(PID(Kc=1.2)))
    assert found.pid is not None
    assert found.pid.Ti == math.inf
    assert found.Ti is None
    assert found.pid.Kc == pytest.approx(1.2, rel=1e-6)


def test_a_direct_acting_controller_keeps_a_positive_gain() -> None:
    record = run(PID(Kc=1.2, Ti=70.0))
    found = running_controller(Record(t=record.t, sp=record.sp, pv=record.pv, op=-record.op))
    assert found.pid is not None
    assert found.pid.action is Action.DIRECT
    assert found.pid.Kc == pytest.approx(1.2, rel=1e-9)


def test_stretches_at_a_limit_of_the_output_are_left_out() -> None:
    record = run(PID(Kc=3.0, Ti=70.0), limits=OutputLimits(low=48.0, high=56.0))
    found = running_controller(record)
    assert found.pid is not None
    assert found.rows < 1800
    assert (found.pid.Kc, found.pid.Ti) == pytest.approx((3.0, 70.0), rel=0.02)


def test_an_output_that_follows_one_sample_late_is_noticed() -> None:
    record = run(PID(Kc=1.2, Ti=70.0))
    assert record.sp is not None
    late = Record(t=record.t[1:], sp=record.sp[1:], pv=record.pv[1:], op=record.op[:-1])
    found = running_controller(late)
    assert found.late == 1
    assert found.pid is not None
    assert found.pid.Kc == pytest.approx(1.2, rel=1e-9)


def test_a_coarse_resolution_costs_the_verdict_and_not_only_digits() -> None:
    record = run(PID(Kc=1.2, Ti=70.0))
    fine, coarse = (
        running_controller(
            Record(t=record.t, sp=record.sp, pv=np.round(record.pv / q) * q, op=record.op)
        )
        for q in (0.02, 0.5)
    )
    assert fine.pid is not None
    assert fine.pid.Kc == pytest.approx(1.2, rel=0.02)
    assert coarse.verdict is not Verdict.TRUSTED
    assert fine.verdict is Verdict.TRUSTED


def test_an_output_that_something_else_moves_is_refused() -> None:
    record = run(PID(Kc=1.2, Ti=70.0))
    other = np.cumsum(np.random.default_rng(1).normal(0.0, 2.0, len(record)))
    found = running_controller(Record(t=record.t, sp=record.sp, pv=record.pv, op=other))
    assert found.pid is None
    assert found.verdict is Verdict.REFUSED
    assert found.reasons


@pytest.mark.parametrize("what", ["manual", "no set point", "op stands", "all stand", "few"])
def test_records_that_cannot_tell_are_refused_in_words(what: str) -> None:
    record = run(PID(Kc=1.2, Ti=70.0), noise=0.0)
    assert record.sp is not None
    t, pv, op, mode = record.t, record.pv, record.op, None
    sp: Real | None = record.sp
    if what == "manual":
        mode = np.full(t.size, Mode.MAN, dtype=np.int8)
    elif what == "no set point":
        sp = None
        mode = np.full(t.size, Mode.AUTO, dtype=np.int8)
    elif what == "op stands":
        op = np.where(t < 5, 49.0, np.where(t > 1790, 51.0, 50.0))
    elif what == "all stand":
        pv, sp = np.full(t.size, 40.0), np.full(t.size, 40.0)
    else:
        t, sp, pv, op = t[:30], record.sp[:30], pv[:30], op[:30]
    found = running_controller(Record(t=t, sp=sp, pv=pv, op=op, mode=mode))
    assert found.pid is None
    assert found.reasons[0].endswith(".")
