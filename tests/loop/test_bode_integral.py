import math

import numpy as np
import pytest
from scipy.integrate import quad

from loop.bode_integral import bode_integral
from loop.compensators import Notch
from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.internal_stability import internal_stability
from loop.process import FOPDT, IPDT, Process, TransferFunction
from loop.response import sensitivity

HEATER = FOPDT(K=2, tau=120, theta=30)

LOOPS: list[tuple[Process, PID, float]] = [
    (HEATER, PID(Kc=0.45, Ti=135, Td=13.3), 0.0),
    (IPDT(K=1, theta=1), PID(Kc=0.4, Ti=8), 0.0),
    (TransferFunction((1.0,), (1.0, -1.0), 0.2), PID(Kc=2), math.pi),
    (TransferFunction((1.0,), (1.0, -1.0, 0.0), 0.1), PID(Kc=3, Td=2, N=20), math.pi),
    (TransferFunction((1.0,), (1.0, 3.0, 2.0, 0.0)), PID(Kc=1), 0.0),
    (TransferFunction((0.2,), (1.0, 0.002, 1.0), 6.0), PID(Kc=0.005), 0.0),
    # Two integrators: at low frequency L is large with a phase of -180°.
    (TransferFunction((1.0,), (0.1, 1.0, 0.0, 0.0)), PID(Kc=0.5, Td=3), 0.0),
    # L falls with 1/s only and there is no dead time: feedback is then not for nothing.
    (FOPDT(K=2, tau=120, theta=0), PID(Kc=0.45, Ti=135), -math.pi / 2 * 0.9 / 120),
]


@pytest.mark.parametrize(("process", "pid", "expected"), LOOPS)
def test_the_integral_is_what_bode_says(process: Process, pid: PID, expected: float) -> None:
    found = bode_integral(process, pid)
    scale = max(abs(expected), 1 / process.theta if process.theta else 1.0)

    assert found.expected == pytest.approx(expected, abs=1e-12)
    assert found.integral == pytest.approx(expected, abs=1e-9 * scale)


def test_the_integral_is_the_one_an_adaptive_rule_finds() -> None:
    process, pid = TransferFunction((1.0,), (1.0, 3.0, 2.0, 0.0)), PID(Kc=1)

    def ln_s(w: float) -> float:
        return float(np.log(np.abs(sensitivity(process, pid, np.array(w)))))

    part = quad(ln_s, 1e-9, 1.0, limit=200)[0] + quad(ln_s, 1.0, 1e3, limit=400)[0]
    assert part == pytest.approx(bode_integral(process, pid).integral, abs=1e-5)


def test_where_the_law_does_not_hold_it_is_not_quoted() -> None:
    with pytest.raises(UnstableLoop):
        bode_integral(HEATER, PID(Kc=10))
    with pytest.raises(ValueError, match="the integral does not exist"):
        bode_integral(TransferFunction((0.5, 1.0), (1.0, 1.0), 1.0), PID(Kc=0.5))
    with pytest.raises(ValueError, match="too often to integrate"):
        bode_integral(FOPDT(K=0.9, tau=1, theta=1e6), PID(Kc=1))


def test_an_integrator_that_a_zero_of_the_process_hides_is_named() -> None:
    found = internal_stability(TransferFunction((1.0, 0.0), (1.0, 2.0, 1.0)), PID(Kc=0.1, Ti=5))

    assert not found.stable
    assert found.unstable == 1
    assert [(c.root, c.pole_of) for c in found.cancellations] == [(0j, "controller")]
    assert "hides the controller's pole at the origin" in found.cancellations[0].sentence


def test_a_notch_on_an_undamped_resonance_hides_it_only_if_it_is_exact() -> None:
    # The narrowest notch a compensator may have still leaves the pair where it is.
    process = TransferFunction((1.0,), (1.0, 0.0, 4.0))
    notch = Notch(w0=2.0, zeta_zero=1e-9, zeta_pole=1.0)
    found = internal_stability(process, PID(Kc=0.5), compensators=[notch])

    assert not found.stable
    assert {c.pole_of for c in found.cancellations} == {"process"}
    assert "2j rad/s" in found.cancellations[0].sentence
    assert internal_stability(HEATER, PID(Kc=0.45, Ti=135)).stable


def test_the_wrong_action_shows_as_an_unstable_pole_without_any_cancellation() -> None:
    found = internal_stability(HEATER, PID(Kc=0.45, Ti=135, action=Action.DIRECT))

    assert (found.stable, found.unstable, found.cancellations) == (False, 1, ())


def test_an_unstable_pole_that_nothing_hides_is_counted_and_not_named() -> None:
    process = TransferFunction((1.0,), (10.0, -1.0))
    found = internal_stability(process, PID(Kc=0.5))

    assert (found.unstable, found.cancellations) == (1, ())
