"""Margins on processes of any order: the batch against the scalar, loop by loop."""

import math

import numpy as np
import pytest

from loop.chain_margins import full_margins
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.half_rule import half_rule
from loop.margins import margins
from loop.process import FOPDT, Process, TransferFunction

NAMES = ("gain", "gain_reduction", "phase", "delay", "Ms", "Mt")
CHAINS = {
    "zero in the right half-plane": TransferFunction((-0.3, 1.0), (0.8, 3.2, 3.4, 1.0), 0.5),
    "four equal lags": TransferFunction((1.0,), (1.0, 4.0, 6.0, 4.0, 1.0)),
    "integrator with two lags": TransferFunction((-2.0,), (1.0, 2.0, 1.0, 0.0), 0.3),
    "numerator lag": TransferFunction((15.0, 1.0), (20.0, 21.2, 2.21, 0.01, 0.0), 0.1),
    "two integrators": TransferFunction((3.0, 1.0), (0.5, 1.0, 0.0, 0.0), 0.05),
    "as many zeros as poles": TransferFunction((-1.0, 1.0), (1.0, 1.0), 0.2),
    "as many zeros as poles, no dead time": TransferFunction((-1.0, 1.0), (1.0, 1.0)),
    "damped poles": TransferFunction((1.0,), (1.0, 1.4, 1.0), 0.4),
    "poles of its own": TransferFunction((1.0,), (4.0, 0.4, 1.0), 0.4),
}


def settings(process: Process) -> tuple[PID, ...]:
    """P, PI, PD and PID from calm to unstable."""
    action = PID(Kc=1.0).action if process.numerator[-1] > 0 else None
    found = []
    for Kc in (0.02, 0.2, 1.0, 8.0):
        for Ti, Td in ((math.inf, 0.0), (5.0, 0.0), (math.inf, 0.3), (6.0, 0.5), (0.5, 0.2)):
            pid = PID(Kc=Kc, Ti=Ti, Td=Td, tauF=0.1 * Td)
            found.append(pid if action else PID(Kc=Kc, Ti=Ti, Td=Td, action=pid.action.DIRECT))
    return tuple(found)


@pytest.mark.parametrize("sample_time", [0.0, 0.4])
@pytest.mark.parametrize("process", CHAINS.values(), ids=CHAINS.keys())
def test_every_loop_is_the_scalar_one(process: TransferFunction, sample_time: float) -> None:
    """Second route: the scalar margins, by another walk over the axis."""
    controllers = settings(process)
    found = full_margins(process, controllers, sample_time=sample_time)
    stable = 0
    for row, pid in enumerate(controllers):
        values = [float(getattr(found, name)[row]) for name in NAMES]
        try:
            one = margins(process, pid, sample_time=sample_time)
        except UnstableLoop:
            assert not found.stable[row]
            assert values == [0.0, 0.0, 0.0, 0.0, math.inf, math.inf]
            continue
        stable += 1
        assert found.stable[row]
        assert values == pytest.approx([getattr(one, name) for name in NAMES], rel=1e-6)
    assert 0 < stable < len(controllers) or process.theta == 0


def test_a_low_order_process_is_taken_as_well() -> None:
    process = FOPDT(K=2.0, tau=120.0, theta=30.0)
    pid = PID(Kc=0.45, Ti=135.0, Td=13.3)
    found = full_margins(process, (pid,))
    assert found.gain[0] == pytest.approx(7.28357, abs=5e-6)
    assert found.Ms[0] == pytest.approx(1.16282, abs=5e-6)


def test_the_full_process_is_not_its_model() -> None:
    """The same settings on both: the half rule is an approximation, and a safe one here."""
    process = CHAINS["four equal lags"]
    model = half_rule(process).model
    pid = PID(Kc=0.3, Ti=1.5)
    full = full_margins(process, (pid,))
    assert full.Ms[0] == pytest.approx(1.463, abs=5e-4)
    assert margins(model, pid).Ms == pytest.approx(1.590, abs=5e-4)


@pytest.mark.parametrize("sample_time", [-1.0, math.nan, math.inf])
def test_an_impossible_scan_time_is_refused(sample_time: float) -> None:
    with pytest.raises(ValueError, match="sample_time"):
        full_margins(CHAINS["damped poles"], (PID(Kc=1.0),), sample_time=sample_time)


def test_the_batch_does_not_depend_on_the_unit_of_time() -> None:
    here, unit = CHAINS["zero in the right half-plane"], 60.0
    there = TransferFunction(
        tuple(c * unit**i for i, c in zip((1, 0), here.numerator, strict=True)),
        tuple(c * unit**i for i, c in zip((3, 2, 1, 0), here.denominator, strict=True)),
        here.theta * unit,
    )
    a = full_margins(here, (PID(Kc=1.0, Ti=2.0),))
    b = full_margins(there, (PID(Kc=1.0, Ti=2.0 * unit),))
    np.testing.assert_allclose(
        [b.gain[0], b.phase[0], b.delay[0] / unit, b.Ms[0], b.Mt[0]],
        [a.gain[0], a.phase[0], a.delay[0], a.Ms[0], a.Mt[0]],
        rtol=1e-9,
    )
