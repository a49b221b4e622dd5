import math
import warnings

import control
import numpy as np
import pytest

from loop.controller import PID, Action, controller_response
from loop.errors import INFINITELY_MANY
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    TransferFunction,
    rational_response,
)
from loop.stability import unstable_poles


def random_loop(rng: np.random.Generator) -> tuple[Process, PID]:
    """A plant of up to five poles, some unstable or resonant, with any PID."""
    poles: list[complex] = [-(10 ** rng.uniform(-1, 1)) for _ in range(rng.integers(1, 3))]
    if rng.random() < 0.3:
        poles[0] = -poles[0]
    if rng.random() < 0.4:
        w, zeta = 10 ** rng.uniform(-0.5, 1), rng.choice([-0.1, 0.02, 0.1, 0.5])
        pair = w * complex(-zeta, math.sqrt(1 - zeta**2))
        poles += [pair, pair.conjugate()]
    poles += [0.0] * rng.choice([0, 0, 1, 2])
    zero = 10 ** rng.uniform(-1, 1) * rng.choice([-1, 1])
    zeros = [zero] if len(poles) > 1 and rng.random() < 0.3 else []
    process = TransferFunction(
        tuple(10 ** rng.uniform(-1, 1) * rng.choice([-1, 1]) * np.atleast_1d(np.poly(zeros))),
        tuple(np.poly(poles).real),
        float(rng.choice([0.0, 10 ** rng.uniform(-1.5, 0.5)])),
    )
    controller = PID(
        Kc=10 ** rng.uniform(-1, 1),
        Ti=math.inf if rng.random() < 0.3 else 10 ** rng.uniform(-0.5, 1.5),
        Td=0.0 if rng.random() < 0.4 else 10 ** rng.uniform(-1.5, 0.5),
        tauF=0.0 if rng.random() < 0.7 else 10 ** rng.uniform(-1.5, 0),
        action=Action.REVERSE if rng.random() < 0.7 else Action.DIRECT,
    )
    return process, controller


def encirclements(process: Process, controller: PID) -> tuple[int, float]:
    """Nyquist's Z = N + P on a dense contour around the origin's right, and how close it passes.

    The distance is 0 where the loop still turns with a gain above 1 beyond what the contour sees.
    """
    corner = 1e-7 * np.exp(1j * np.linspace(0, math.pi / 2, 400))
    s = np.concatenate([corner, 1j * np.geomspace(1e-7, 1e4, 50_000)[1:]])
    L = rational_response(process, s) * controller_response(controller, s)
    back = 1 + L * np.exp(-process.theta * s)
    turn = np.unwrap(np.angle(back))
    open_loop = np.roots(process.denominator)
    P = int(np.sum(open_loop.real > 1e-6))
    Z = P - (turn[-1] - turn[0]) / math.pi
    seen = np.max(np.abs(L[np.abs(s) > 300])) < 1
    return round(Z), float(np.min(np.abs(back))) if seen else 0.0


def test_the_count_is_that_of_nyquist() -> None:
    rng = np.random.default_rng(7)
    counts = []
    for _ in range(120):
        process, controller = random_loop(rng)
        expected, nearest = encirclements(process, controller)
        if nearest > 1e-3:
            assert unstable_poles(process, controller) == expected, (process, controller)
            counts.append(expected)
    assert len(counts) > 100
    assert {0, 1, 2, 3, 4} <= set(counts)


def test_the_count_is_that_of_the_roots_with_a_pade_approximation_of_order_ten() -> None:
    rng = np.random.default_rng(3)
    seen = []
    for _ in range(200):
        tau, theta = 10 ** rng.uniform(-0.5, 1), 10 ** rng.uniform(-1, 0.3)
        process = SOPDT(K=float(rng.choice([-1, 1])), tau1=tau, tau2=0.3 * tau, theta=theta)
        controller = PID(
            Kc=10 ** rng.uniform(-0.5, 1),
            Ti=10 ** rng.uniform(-0.5, 1),
            Td=rng.choice([0.0, 0.3]),
            action=Action.REVERSE if rng.random() < 0.7 else Action.DIRECT,
        )
        n, d = control.pade(theta, 10)
        opened = np.polymul(np.polymul(process.numerator, controller.numerator), n)
        closed = np.polyadd(
            np.polymul(np.polymul(process.denominator, controller.denominator), d),
            controller.action.sign * opened,
        )
        roots = np.roots(closed)
        # The approximation holds up to 6/theta; beyond, nothing can be unstable where |L| < 1.
        s = 1j * np.geomspace(6, 600, 50) / theta
        fast = rational_response(process, s) * controller_response(controller, s)
        if np.max(np.abs(fast)) < 1 and np.min(np.abs(roots.real)) > 1e-3:
            expected = int(np.sum(roots.real > 0))
            assert unstable_poles(process, controller) == expected
            seen.append(expected)
    assert len(seen) > 150
    assert {0, 1, 2} <= set(seen)


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_every_further_turn_of_delay_brings_one_more_pair(turns: int) -> None:
    # K/s under P control: a pair crosses at K Kc theta = pi/2 + 2 pi m.
    limit = math.pi / 2 + 2 * math.pi * turns
    below, above = (IPDT(K=1, theta=limit * factor) for factor in (1 - 1e-6, 1 + 1e-6))
    assert unstable_poles(below, PID(Kc=1)) == 2 * turns
    assert unstable_poles(above, PID(Kc=1)) == 2 * turns + 2


def test_delay_can_stabilise_what_is_unstable_without_it() -> None:
    # s^2 + 1 fed back with the wrong sign is an oscillator until the delay turns the feedback.
    process = TransferFunction((1.0,), (1.0, -0.1, 2.0))
    controller = PID(Kc=0.2, action=Action.DIRECT)
    counts = [unstable_poles(process, controller, delay=d) for d in (0.0, 1.0, 3.0, 4.6, 5.5)]
    assert counts == [encirclements_at(process, controller, d) for d in (0.0, 1.0, 3.0, 4.6, 5.5)]
    assert counts[0] == 2
    assert 0 in counts


def encirclements_at(process: TransferFunction, controller: PID, delay: float) -> int:
    delayed = TransferFunction(process.numerator, process.denominator, delay)
    return encirclements(delayed, controller)[0]


@pytest.mark.parametrize(
    ("process", "controller", "count"),
    [
        # On the axis is not stable: two integrators without damping, L(0) = -1, a lost integrator.
        (DoubleIntegrator(K=1, theta=0), PID(Kc=1), 2),
        (FOPDT(K=0.5, tau=1, theta=3), PID(Kc=2, action=Action.DIRECT), 1),
        (TransferFunction((1, 0), (1, 3, 1), 0.1), PID(Kc=1, Ti=1), 1),
        (TransferFunction((8,), (1, 3, 3, 1)), PID(Kc=1), 2),
        (IPDT(K=1, theta=math.pi / 2), PID(Kc=1), 2),
        # The wrong action.
        (FOPDT(K=1, tau=1, theta=1), PID(Kc=2, Ti=1, action=Action.DIRECT), 1),
        (FOPDT(K=-1, tau=1, theta=1), PID(Kc=2, Ti=1), 1),
        (IPDT(K=-1, theta=0), PID(Kc=1), 1),
        (IPDT(K=-1, theta=0), PID(Kc=1, action=Action.DIRECT), 0),
        # Two integrators need phase lead, and dead time takes it away.
        (DoubleIntegrator(K=1, theta=0.1), PID(Kc=1), 2),
        (DoubleIntegrator(K=1, theta=0.1), PID(Kc=1, Td=1), 0),
        (DoubleIntegrator(K=1, theta=0), PID(Kc=1, Ti=1), 2),
        (TransferFunction((1,), (1, 0, 0, 0)), PID(Kc=1), 2),
        # An unstable process, held by a gain between its limits.
        (FOPDT(K=1, tau=1, theta=0), PID(Kc=1), 0),
        (TransferFunction((1,), (1, -1), 0.1), PID(Kc=0.9), 1),
        (TransferFunction((1,), (1, -1), 0.1), PID(Kc=3), 0),
        (TransferFunction((1,), (1, -1), 0.1), PID(Kc=30), 2),
        # A pole that no gain reaches, because a zero lies on it.
        (TransferFunction((1, -1), (1, 1, -2), 0.1), PID(Kc=1), 1),
        # |L| < 1 everywhere, and a loop without any corner.
        (FOPDT(K=0.5, tau=1, theta=9), PID(Kc=1), 0),
        (TransferFunction((0.5,), (1,), 9.0), PID(Kc=1), 0),
        (TransferFunction((0.5,), (1,)), PID(Kc=3), 0),
        # Level gain at high frequency: stable below 1, infinitely many poles from 1 on.
        (FOPDT(K=1, tau=1, theta=0.1), PID(Kc=1, Td=0.5, N=math.inf), 0),
        (FOPDT(K=1, tau=1, theta=0.1), PID(Kc=1, Td=1, N=math.inf), INFINITELY_MANY),
        (TransferFunction((1,), (1,), 0.1), PID(Kc=2), INFINITELY_MANY),
        (TransferFunction((1,), (1,), 0.1), PID(Kc=0.1, Td=1, N=math.inf), INFINITELY_MANY),
        (FOPDT(K=1, tau=1, theta=0), PID(Kc=1, Td=1, N=math.inf), 0),
        (TransferFunction((1,), (1,)), PID(Kc=2, Td=1, N=math.inf), 0),
        # All-pass at gain 1: a pole at the origin, or with the other sign one lost at infinity.
        (TransferFunction((1, -1), (1, 1)), PID(Kc=1), 1),
        (TransferFunction((1, -1), (1, 1)), PID(Kc=1, action=Action.DIRECT), 1),
        (TransferFunction((1, -1), (1, 1)), PID(Kc=2), 1),
        (TransferFunction((2, -1), (1, 2)), PID(Kc=1, action=Action.DIRECT), 1),
    ],
)
def test_special_loops(process: Process, controller: PID, count: int) -> None:
    assert unstable_poles(process, controller) == count


@pytest.mark.parametrize("unit", [1e-9, 1e-5, 1e4, 1e8])
def test_the_unit_of_time_does_not_matter(unit: float) -> None:
    rng = np.random.default_rng(11)
    counts = []
    for _ in range(30):
        tau, theta, Ti = 10 ** rng.uniform(0, 0.9, 3)
        Kc = 10 ** rng.uniform(-1, 1)
        counts.append(
            unstable_poles(FOPDT(K=1, tau=tau, theta=theta), PID(Kc=Kc, Ti=Ti, Td=0.2 * theta))
        )
        scaled = FOPDT(K=1, tau=tau * unit, theta=theta * unit)
        assert counts[-1] == unstable_poles(scaled, PID(Kc=Kc, Ti=Ti * unit, Td=0.2 * theta * unit))
    assert len(set(counts)) > 2


def test_parameters_at_their_limits_get_an_answer_without_a_warning() -> None:
    edge = (1e-9, 1.0, 1e9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for K in edge:
            for tau in edge:
                for theta in (0.0, *edge):
                    for Ti in (*edge, math.inf):
                        for Td in (0.0, 5e-324, 1e-9, 1e9):
                            count = unstable_poles(
                                FOPDT(K=K, tau=tau, theta=theta), PID(Kc=1, Ti=Ti, Td=Td)
                            )
                            assert count >= 0


@pytest.mark.parametrize("delay", [-1.0, math.nan, math.inf, 1e300])
def test_an_impossible_delay_is_refused_in_words(delay: float) -> None:
    with pytest.raises(ValueError, match="delay must lie within 0 and 1e\\+30 s"):
        unstable_poles(FOPDT(K=1, tau=1, theta=1), PID(Kc=1), delay=delay)


def test_a_filter_ratio_without_a_filter_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="N is too small"):
        unstable_poles(FOPDT(K=1, tau=1, theta=1), PID(Kc=1, Td=1e9, N=1e-320))


def test_coefficients_without_a_scale_are_refused_in_words() -> None:
    with pytest.raises(ValueError, match="poles and zeros must lie within"):
        unstable_poles(TransferFunction((1,), (1e-300, 1e300)), PID(Kc=1))
