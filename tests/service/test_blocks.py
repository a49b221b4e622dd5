"""Settings of a block to and from the canonical controller, and worked examples by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from loop.controller import PID, Action, ParallelPID, SeriesPID, controller_response
from loop.errors import ConversionRefused
from service.blocks import Block, Controller

ISA = Block(
    form="isa", time_unit="s", gain_basis="eu", action="reverse",
    pv_low=0.0, pv_high=100.0, op_low=0.0, op_high=100.0, pv_unit="degC", op_unit="%",
)  # fmt: skip

positive = st.floats(1e-3, 1e3)
blocks = st.builds(
    Block,
    form=st.sampled_from(["isa", "parallel", "series"]),
    time_unit=st.sampled_from(["s", "min"]),
    gain_basis=st.sampled_from(["eu", "percent"]),
    action=st.sampled_from(["reverse", "direct"]),
    pv_low=st.floats(-500, 0),
    pv_high=st.floats(1, 500),
    op_low=st.floats(-100, 0),
    op_high=st.floats(1, 100),
    pv_unit=st.just("degC"),
    op_unit=st.just("%"),
)
controllers = st.builds(
    PID,
    Kc=positive,
    Ti=positive | st.just(math.inf),
    Td=positive | st.just(0.0),
    N=st.floats(2, 20),
    b=st.floats(0, 1),
    c=st.floats(0, 1),
    tauF=positive | st.just(0.0),
    action=st.sampled_from(Action),
)


@given(block=blocks, pid=controllers)
def test_writing_a_controller_and_reading_it_back_changes_nothing(block: Block, pid: PID) -> None:
    try:
        written = block.written(pid)
    except (ConversionRefused, ValueError):
        assume(False)
    back = block.canonical(written)

    w = 1j * np.logspace(-4, 4, 50)
    np.testing.assert_allclose(controller_response(back, w), controller_response(pid, w), rtol=1e-6)
    assert (back.b, back.c, back.action) == (pid.b, pid.c, pid.action)
    assert math.isinf(back.Ti) == math.isinf(pid.Ti)
    if block.form != "series":  # two real zeros may swap parts, with the same response
        for name in ("Kc", "Ti", "Td", "tauF"):
            assert getattr(back, name) == pytest.approx(getattr(pid, name), rel=1e-9)


@given(block=blocks, pid=controllers)
def test_minutes_change_times_only_and_percent_changes_gains_only(block: Block, pid: PID) -> None:
    isa = replace(block, form="isa", time_unit="s", gain_basis="eu")
    minutes = replace(isa, time_unit="min").written(pid)
    percent = replace(isa, gain_basis="percent").written(pid)
    assert isinstance(minutes, PID)
    assert isinstance(percent, PID)

    assert minutes.Kc == pid.Kc
    assert minutes.Ti * 60 == pytest.approx(pid.Ti)
    assert minutes.Td * 60 == pytest.approx(pid.Td)
    assert minutes.tauF * 60 == pytest.approx(pid.tauF)
    span = (block.op_high - block.op_low) / (block.pv_high - block.pv_low)
    assert percent.Kc * span == pytest.approx(pid.Kc)
    assert (percent.Ti, percent.Td) == (pid.Ti, pid.Td)


@pytest.mark.parametrize(
    ("change", "written", "pid"),
    [
        # An 80 degC error in a 0..200 degC span is 40 %; gain 2 %/% moves OP by 80 % of 0..100 %.
        (
            {"gain_basis": "percent", "pv_high": 200.0},
            PID(Kc=2.0, Ti=30.0),
            PID(Kc=80.0 / 80.0, Ti=30.0),
        ),
        # A valve in 4..20 mA over 0..10 bar: 1 %/% is 16 mA over 10 bar.
        (
            {"gain_basis": "percent", "pv_high": 10.0, "op_low": 4.0, "op_high": 20.0},
            PID(Kc=1.0),
            PID(Kc=1.6),
        ),
        # 0.5 repeats a minute is Ti = 2 min.
        ({"time_unit": "min"}, PID(Kc=1.0, Ti=2.0, Td=0.5), PID(Kc=1.0, Ti=120.0, Td=30.0)),
        # Ki = 0.6 per minute is 0.01 per second: Ti = Kp/Ki = 200 s; Kd = 1 min is 60 s: Td = 30 s.
        (
            {"form": "parallel", "time_unit": "min"},
            ParallelPID(Kp=2.0, Ki=0.6, Kd=1.0, Tf=0.05),
            PID(Kc=2.0, Ti=200.0, Td=30.0, N=10.0),
        ),
        # F = 1 + Td'/Ti' = 1.25 without filter.
        (
            {"form": "series"},
            SeriesPID(Kc=2.0, Ti=40.0, Td=10.0, alpha=0.0),
            PID(Kc=2.5, Ti=50.0, Td=8.0, N=math.inf),
        ),
    ],
)
def test_worked_conversions(change: dict[str, object], written: Controller, pid: PID) -> None:
    block = replace(ISA, **change)

    found = block.canonical(written)

    assert found.Kc == pytest.approx(pid.Kc)
    assert found.Ti == pytest.approx(pid.Ti)
    assert found.Td == pytest.approx(pid.Td)
    assert found.filter_time == pytest.approx(pid.filter_time)


def test_a_block_without_an_equivalent_refuses() -> None:
    with pytest.raises(ConversionRefused, match="no series form"):
        replace(ISA, form="series").written(PID(Kc=1.0, Ti=10.0, Td=5.0))


def test_every_number_has_its_unit() -> None:
    percent = replace(ISA, gain_basis="percent", time_unit="min")
    assert percent.units()["Kc"] == "%/%"
    assert percent.units()["Ti"] == "min"
    assert ISA.units()["Kc"] == "%/degC"
    assert ISA.units()["op_rate"] == "%/s"
    assert replace(ISA, form="parallel", pv_unit="").units()["Ki"] == "%/PV/s"
