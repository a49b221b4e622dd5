import math

import numpy as np
import pytest
from scipy.special import lambertw

from loop.closed_loop_poles import Rectangle, closed_loop_poles
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.margins import margins
from loop.process import FOPDT, IPDT, Process, TransferFunction
from loop.root_locus import root_locus
from loop.stability import unstable_poles

HEATER = FOPDT(K=2, tau=120, theta=30)
RUNNING = PID(Kc=0.45, Ti=135, Td=13.3)


def test_poles_of_an_integrator_with_dead_time_are_branches_of_lamberts_function() -> None:
    # s + K e^(-theta s) = 0 has the roots W_k(-K theta)/theta.
    process, pid = IPDT(K=0.8, theta=1.5), PID(Kc=1)
    view = Rectangle(left=-4.0, right=2.0, height=40.0)
    found = closed_loop_poles(process, pid, rectangle=view)
    known = np.array([lambertw(-1.2, k) / 1.5 for k in range(-14, 15)])
    inside = known[(known.real > -4) & (np.abs(known.imag) < 40)]

    assert found.poles.size == inside.size > 15
    for root in inside:
        assert np.min(np.abs(found.poles - root)) < 1e-12 * (1 + abs(root))
    assert np.all(found.residual < 1e-12)


def test_without_dead_time_all_poles_are_those_of_the_polynomial() -> None:
    process = TransferFunction((2.0,), (1.0, 3.0, 2.0))
    found = closed_loop_poles(process, PID(Kc=1.5, Ti=2.0))

    # 2 s (s^2 + 3 s + 2) + 2 (3 s + 1.5)
    expected = np.roots([2.0, 6.0, 10.0, 3.0])
    assert found.rectangle is None
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(expected))


def random_loop(rng: np.random.Generator, kind: int) -> tuple[Process, PID]:
    K, theta = 10 ** rng.uniform(-1, 0.5), 10 ** rng.uniform(-1.5, 0.7)
    kinds: list[Process] = [
        FOPDT(K=K, tau=1.0, theta=theta),
        IPDT(K=K, theta=theta),
        TransferFunction((K,), (1.0, -1.0), theta),
        TransferFunction((K,), (1.0, 0.02, 1.0), theta),
        TransferFunction((-K, 2 * K), (1.0, 0.7, 1.0, 0.0), theta),
        TransferFunction((0.5, 1.0), (1.0, 1.0), theta),
    ]
    Kc = 0.5 if kind == 5 else 10 ** rng.uniform(-1.5, 0.3)
    Ti = float(rng.choice([math.inf, 10 ** rng.uniform(-0.5, 1)]))
    return kinds[kind], PID(Kc=Kc, Ti=Ti)


def test_the_poles_right_of_the_axis_are_as_many_as_the_direct_method_counts() -> None:
    rng = np.random.default_rng(5)
    counts = set()
    for i in range(60):
        process, pid = random_loop(rng, i % 6)
        found = closed_loop_poles(process, pid)
        count = int(np.sum(found.poles.real >= 0))
        assert count == unstable_poles(process, pid), (process, pid)
        assert np.all(found.residual < 1e-8)
        assert np.all(np.diff(found.poles.real) <= 1e-12 * np.abs(found.poles[1:]) + 1e-15)
        counts.add(count)
    assert {0, 1, 2} <= counts


def test_a_double_pole_is_found_twice() -> None:
    # s + K e^(-s) has a double root at -1 for K = 1/e.
    found = closed_loop_poles(IPDT(K=math.exp(-1), theta=1.0), PID(Kc=1.0))

    np.testing.assert_allclose(found.poles[:2], [-1.0, -1.0], atol=1e-6)


def test_at_the_gain_margin_a_pole_pair_stands_on_the_axis() -> None:
    limit = margins(HEATER, RUNNING).gain
    found = closed_loop_poles(HEATER, PID(Kc=0.45 * limit, Ti=135, Td=13.3))

    assert np.max(np.abs(found.poles[:2].real)) < 1e-12
    assert found.poles[1].imag == pytest.approx(-found.poles[0].imag)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6])
def test_a_pole_that_the_integral_time_hides_is_a_pole_all_the_same(apart: float) -> None:
    # Ti = tau: the lag stays in the response to a load, though L does not show it.
    pid = PID(Kc=120 * (1 + apart) / (2 * 60), Ti=120 * (1 + apart))
    found = closed_loop_poles(HEATER, pid)

    assert np.min(np.abs(found.poles * 120 + 1)) < 3e-6
    assert np.all(found.residual < 1e-8)
    assert closed_loop_poles(FOPDT(K=2, tau=120, theta=0), pid).poles.size == 2


def test_what_has_no_such_poles_is_refused() -> None:
    with pytest.raises(UnstableLoop, match="infinitely many"):
        closed_loop_poles(FOPDT(K=2, tau=1, theta=1), PID(Kc=1, Td=5, N=math.inf))
    with pytest.raises(ValueError, match="ask for a smaller one"):
        closed_loop_poles(HEATER, RUNNING, rectangle=Rectangle(left=-0.1, right=0.1, height=1000.0))
    for edges in ((1.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-math.inf, 1.0, 1.0)):
        with pytest.raises(ValueError, match="left below right and a positive height"):
            Rectangle(left=edges[0], right=edges[1], height=edges[2])


def test_every_point_of_the_locus_is_a_pole_of_its_own_gain() -> None:
    k = np.array([0.1, 1.0, 5.0, 9.0])
    found = root_locus(HEATER, RUNNING, k=k)

    for factor, row in zip(k, found.branches, strict=True):
        poles = row[~np.isnan(row)]
        s = poles
        G = 2 * np.exp(-30 * s) / (120 * s + 1)
        C = 0.45 * (1 + 1 / (135 * s) + 13.3 * s / (1 + 1.33 * s))
        np.testing.assert_allclose(factor * G * C, -1.0, atol=1e-9)
        count = unstable_poles(HEATER, PID(Kc=0.45 * factor, Ti=135, Td=13.3))
        assert np.sum(poles.real > 0) == count


def test_the_locus_crosses_the_axis_at_the_gain_margin_and_at_every_later_gain() -> None:
    found = root_locus(HEATER, RUNNING)
    known = margins(HEATER, RUNNING)

    assert found.crossings[0][0] == pytest.approx(known.gain, rel=1e-12)
    for k, _ in found.crossings:
        below, above = (
            unstable_poles(HEATER, PID(Kc=0.45 * k * part, Ti=135, Td=13.3))
            for part in (0.999, 1.001)
        )
        assert above - below == 2
    unstable = np.sum(found.branches.real > 0, axis=1)
    expected = [2 * sum(c <= k for c, _ in found.crossings) for k in found.k]
    np.testing.assert_array_equal(unstable, expected)


def test_branches_are_smooth_and_start_at_the_open_loop_poles() -> None:
    process = TransferFunction((1.0,), (1.0, 3.0, 2.0, 0.0))
    found = root_locus(process, PID(Kc=1), k=np.geomspace(1e-6, 20, 300))

    assert found.branches.shape == (300, 3)
    np.testing.assert_allclose(np.sort_complex(found.branches[0]), [-2, -1, 0], atol=1e-5)
    assert len(found.crossings) == 1
    assert found.crossings[0] == pytest.approx((6.0, math.sqrt(2)))
    # Two meet at -0.4226 and leave the axis; none jumps there.
    assert np.max(np.abs(np.diff(found.branches, axis=0))) < 0.15
    # An unstable process: the real pole passes the origin at K Kc = 1.
    lag = TransferFunction((1.0,), (10.0, -1.0))
    assert root_locus(lag, PID(Kc=1)).crossings == ((1.0, 0.0),)


def test_gains_that_make_no_locus_are_refused() -> None:
    for k in ([1.0], [0.0, 1.0], [2.0, 1.0], [1.0, math.inf]):
        with pytest.raises(ValueError, match="must be positive and ascend"):
            root_locus(HEATER, RUNNING, k=np.array(k))
    flat = TransferFunction((0.5, 1.0), (1.0, 1.0), 1.0)
    with pytest.raises(ValueError, match="from 4 times the gain on infinitely many poles"):
        root_locus(flat, PID(Kc=0.5), k=np.array([1.0, 5.0]))
    with pytest.raises(ValueError, match="from 0 times the gain on"):
        root_locus(flat, PID(Kc=0.5, Td=1, N=math.inf))
    assert root_locus(flat, PID(Kc=0.5)).k[-1] == pytest.approx(3.6)
    with pytest.raises(ValueError, match="ask for smaller factors"):
        root_locus(HEATER, RUNNING, k=np.array([1.0, 1e9]))
