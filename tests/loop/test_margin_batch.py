import math
import warnings
from dataclasses import fields

import control
import numpy as np
import pytest

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.falling_batch import falling_margins
from loop.lag_loops import LagLoops
from loop.lti import controller_to_control, to_control
from loop.margin_batch import MarginBatch, batch_margins
from loop.margins import Margins, margins
from loop.process import FOPDT, TransferFunction
from loop.scan_batch import scan_margins
from loop.signals import Complex, Real

NAMES = tuple(item.name for item in fields(Margins))


def random_batch(seed: int, n: int, spread: float = 1.0) -> tuple[ProcessBatch, PIDBatch]:
    """Every kind of plant and controller, some with the wrong action, some without dead time."""
    rng = np.random.default_rng(seed)

    def times(low: float, high: float, part: float) -> Real:
        drawn = np.clip(10 ** (spread * rng.uniform(low, high, n)), 1e-9, 1e9)
        return np.where(rng.random(n) < part, drawn, 0.0)

    integrators = rng.choice([0, 0, 0, 1, 2], n)
    tau1 = times(-1, 1, 0.8)
    K = np.clip(10 ** (spread * rng.uniform(-1, 1, n)), 1e-9, 1e9) * rng.choice([1, 1, -1], n)
    Ti = times(-1, 1.5, 0.8)
    processes = ProcessBatch(
        K=K,
        tau1=np.where((integrators == 0) & (tau1 == 0), 1.0, tau1),
        tau2=times(-1.5, 0.5, 0.3),
        integrators=integrators,
        theta=times(-1.5, 1, 0.85),
    )
    controllers = PIDBatch(
        Kc=np.clip(10 ** (spread * rng.uniform(-1.5, 0.7, n)), 1e-9, 1e9),
        Ti=np.where(Ti > 0, Ti, math.inf),
        Td=times(-2, 1, 0.6),
        N=np.where(rng.random(n) < 0.9, 10.0, rng.choice([3.0, math.inf, 20.0], n)),
        tauF=times(-2, 0.5, 0.2),
        sign=np.where(rng.random(n) < 0.93, np.sign(K), -np.sign(K)),
    )
    return processes, controllers


def one_of(processes: ProcessBatch, controllers: PIDBatch, i: int) -> tuple[TransferFunction, PID]:
    p, c = processes, controllers
    lags = np.polymul((p.tau1[i], 1.0), (p.tau2[i], 1.0))
    process = TransferFunction(
        (p.K[i],), tuple(lags) + (0.0,) * int(p.integrators[i]), float(p.theta[i])
    )
    action = Action.REVERSE if c.sign[i] > 0 else Action.DIRECT
    controller = PID(Kc=c.Kc[i], Ti=c.Ti[i], Td=c.Td[i], N=c.N[i], tauF=c.tauF[i], action=action)
    return process, controller


def response(processes: ProcessBatch, controllers: PIDBatch, w: Real) -> Complex:
    """L(jw) as the models print it, shape (n, m)."""
    s = 1j * w

    def column(a: Real) -> Real:
        return np.asarray(a)[:, None]

    p, c = processes, controllers
    Td, Tf = column(c.Td), column(c.Td / c.N)
    C = 1 + column(1 / c.Ti) / s + Td * s / (1 + Tf * s)
    C = column(c.sign * c.Kc) * C / (column(c.tauF) * s + 1)
    lags = (column(p.tau1) * s + 1) * (column(p.tau2) * s + 1)
    G = column(p.K) * np.exp(-column(p.theta) * s) / (s ** column(p.integrators) * lags)
    return np.asarray(C * G)


def sensitivity_size(L: Complex) -> Real:
    return np.asarray(1 / np.abs(1 + L))


def complementary_size(L: Complex) -> Real:
    return np.asarray(np.abs(L / (1 + L)))


def pick(batch: ProcessBatch | PIDBatch, rows: Real) -> dict[str, Real]:
    return {item.name: getattr(batch, item.name)[rows] for item in fields(batch)}


@pytest.mark.parametrize(("seed", "spread"), [(1, 1.0), (2, 2.5)])
def test_a_batch_gives_what_each_loop_gives_alone(seed: int, spread: float) -> None:
    processes, controllers = random_batch(seed, 200, spread)
    found = batch_margins(processes, controllers)
    stable = 0
    for i in range(200):
        try:
            alone = margins(*one_of(processes, controllers, i))
        except UnstableLoop:
            assert not found.stable[i]
            continue
        assert found.stable[i]
        stable += 1
        for name in NAMES:
            expected = pytest.approx(getattr(alone, name), rel=1e-9)
            assert float(getattr(found, name)[i]) == expected, (name, i)
    assert 60 < stable < 160


@pytest.mark.parametrize(("seed", "spread"), [(3, 1.0), (9, 2.5)])
def test_loops_whose_gain_falls_get_what_the_full_scan_gives(seed: int, spread: float) -> None:
    processes, controllers = random_batch(seed, 4000, spread)
    loops = LagLoops.of(processes, controllers, np.zeros(()), processes.shape)
    fast, proven = falling_margins(loops)
    assert 0.4 < np.mean(proven) < 0.6
    rows = np.flatnonzero(proven)
    slow = scan_margins(loops.take(rows))
    np.testing.assert_array_equal(fast.stable[rows], slow.stable)
    for name in NAMES:
        found = getattr(fast, name)[rows]
        np.testing.assert_allclose(found, getattr(slow, name), rtol=1e-9, err_msg=name)


def test_a_thousand_random_loops_against_a_dense_grid() -> None:
    processes, controllers = random_batch(4, 1000)
    found = batch_margins(processes, controllers)
    rows = np.flatnonzero(found.stable)
    assert rows.size > 400
    w = np.geomspace(1e-4, 1e3, 16_001)
    inner = 0
    for part in np.array_split(rows, 20):
        p, c = ProcessBatch(**pick(processes, part)), PIDBatch(**pick(controllers, part))
        L = response(p, c, w)
        _bounds_at_crossovers(L, w, found, part)
        for peak, size in ((found.Ms, sensitivity_size), (found.Mt, complementary_size)):
            values = size(L)
            assert np.all(peak[part] >= np.max(values, axis=1) * (1 - 1e-12))
            at = np.argmax(values, axis=1)
            mid = (at > 0) & (at < w.size - 1)
            low, high = w[np.maximum(at - 1, 0)], w[np.minimum(at + 1, w.size - 1)]
            for _ in range(6):  # ever denser about the highest point
                zoom = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, 41)
                values = size(response(p, c, zoom))
                at = np.clip(np.argmax(values, axis=1), 1, 39)[:, None]
                low, high = (np.take_along_axis(zoom, at + k, axis=1)[:, 0] for k in (-1, 1))
            seen = np.max(values, axis=1)
            np.testing.assert_allclose(peak[part][mid], seen[mid], rtol=1e-9)
            inner += int(np.sum(mid))
    assert inner > rows.size


def _bounds_at_crossovers(L: Complex, w: Real, found: MarginBatch, part: Real) -> None:
    """At every -180° and every gain 1 between two points of the grid, interpolated."""
    for i, row in enumerate(part):
        size, imag = np.abs(L[i]), L[i].imag
        steps = np.abs(np.diff(np.angle(L[i])))
        fine = np.minimum(steps, 2 * math.pi - steps) < 0.1
        at = np.flatnonzero((imag[:-1] * imag[1:] < 0) & (L[i].real[:-1] < 0) & fine)
        inverse = 1 / size[at]
        near = 0.02  # a cell spans up to 0.1 rad and less than 2 % in gain
        assert np.all(found.gain[row] <= inverse[inverse > 1 + near] * (1 + near))
        assert np.all(found.gain_reduction[row] >= inverse[inverse < 1 - near] * (1 - near))
        cross = np.flatnonzero((size[:-1] - 1) * (size[1:] - 1) < 0)
        lag = np.mod(np.angle(L[i, cross]) + math.pi, 2 * math.pi)
        assert np.all(np.radians(found.phase[row]) <= np.minimum(lag, 2 * math.pi - lag) + 0.2)
        assert np.all(found.delay[row] <= (lag + 0.2) / w[cross])
        if not cross.size:
            assert found.phase[row] == math.inf


def test_a_thousand_random_loops_against_python_control_with_pade_of_order_ten() -> None:
    rng = np.random.default_rng(8)
    n = 1000
    theta, tau = 10 ** rng.uniform(-0.5, 0.5, n), 10 ** rng.uniform(-0.5, 1, n)
    Kc, Ti = 10 ** rng.uniform(-1, 0.2, n) * (1 + tau / theta), 10 ** rng.uniform(0, 1, n)
    Td = np.where(rng.random(n) < 0.5, 0.0, 0.3 * theta)
    zero = np.asarray(0)
    processes = ProcessBatch(K=np.ones(()), tau1=tau, tau2=zero, integrators=zero, theta=theta)
    found = batch_margins(processes, PIDBatch(Kc=Kc, Ti=Ti, Td=Td))
    compared = 0
    for i in np.flatnonzero(found.stable):
        process = FOPDT(K=1, tau=tau[i], theta=theta[i])
        controller = PID(Kc=Kc[i], Ti=Ti[i], Td=Td[i])
        loop = to_control(process, pade_order=10) * controller_to_control(controller)
        gain, phase, _, w180, crossover, _ = control.stability_margins(loop)
        if w180 * theta[i] > 12:  # beyond the reach of the approximation
            continue
        assert (found.gain[i], found.phase[i]) == pytest.approx((gain, abs(phase)), rel=1e-6)
        if phase > 0:
            assert found.delay[i] == pytest.approx(math.radians(phase) / crossover, rel=1e-6)
        compared += 1
    assert compared > 500


def test_heater_at_its_worst_within_half_of_every_parameter() -> None:
    f = np.linspace(0.5, 1.5, 5)
    K, tau, theta = np.meshgrid(f, f, f)
    heater = ProcessBatch.of(FOPDT(K=2, tau=120, theta=30)).scaled(K=K, tau=tau, theta=theta)
    found = batch_margins(heater, PIDBatch.of(PID(Kc=0.45, Ti=135, Td=13.3)))
    assert found.stable.shape == (5, 5, 5)
    assert f"{found.gain.min():.3f} {found.phase.min():.1f}" == "2.065 64.9"
    assert f"{found.delay.min():.1f} {found.Ms.max():.3f}" == "86.7 1.970"


def test_unstable_entries_hold_no_margin_and_never_nan() -> None:
    controllers = PIDBatch(Kc=np.array([1.0, 100.0, 1.0]), Ti=np.asarray(5.0), sign=[1, 1, -1])
    found = batch_margins(ProcessBatch.of(FOPDT(K=1, tau=5, theta=1)), controllers)
    np.testing.assert_array_equal(found.stable, [True, False, False])
    assert not batch_margins(
        ProcessBatch.of(FOPDT(K=1, tau=5, theta=1)), PIDBatch.of(PID(Kc=100, Ti=5))
    ).stable
    for name, value in zip(NAMES, (0, 0, 0, 0, math.inf, math.inf), strict=True):
        np.testing.assert_array_equal(getattr(found, name)[1:], [value, value])


def test_shapes_broadcast_and_empty_batches_are_fine() -> None:
    process = ProcessBatch.of(FOPDT(K=1, tau=5, theta=1))
    assert batch_margins(process, PIDBatch.of(PID(Kc=1, Ti=5))).gain.shape == ()
    wide = batch_margins(process.scaled(K=np.ones((4, 1))), PIDBatch(Kc=np.ones(3)))
    assert wide.Ms.shape == (4, 3)
    empty = batch_margins(process, PIDBatch(Kc=np.ones((0, 3))))
    assert empty.stable.shape == (0, 3)


def test_a_batch_of_many_chunks_is_that_of_its_parts() -> None:
    processes, controllers = random_batch(5, 2500)
    whole = batch_margins(processes, controllers)
    tail = np.arange(2300, 2500)
    part = batch_margins(ProcessBatch(**pick(processes, tail)), PIDBatch(**pick(controllers, tail)))
    for name in ("stable", *NAMES):
        np.testing.assert_allclose(getattr(whole, name)[tail], getattr(part, name), rtol=1e-10)


def test_sampling_costs_half_a_scan_of_delay() -> None:
    process, controller = FOPDT(K=1, tau=5, theta=1), PID(Kc=2, Ti=5)
    h = np.array([0.0, 0.2, 1.0])
    found = batch_margins(ProcessBatch.of(process), PIDBatch.of(controller), sample_time=h)
    for i, sample_time in enumerate(h):
        alone = margins(process, controller, sample_time=float(sample_time))
        assert found.delay[i] == pytest.approx(alone.delay, rel=1e-11)
        assert found.gain[i] == pytest.approx(alone.gain, rel=1e-11)


@pytest.mark.parametrize("sample_time", [-1.0, math.nan, math.inf, 1e300])
def test_an_impossible_sample_time_is_refused_in_words(sample_time: float) -> None:
    process = ProcessBatch.of(FOPDT(K=1, tau=5, theta=1))
    with pytest.raises(ValueError, match="sample_time must lie within 0 and 1e\\+09 s"):
        batch_margins(process, PIDBatch.of(PID(Kc=1)), sample_time=[0.0, sample_time])


@pytest.mark.parametrize("seed", [6, 7])
def test_the_widest_range_of_parameters_gives_numbers_without_a_warning(seed: int) -> None:
    processes, controllers = random_batch(seed, 400, spread=9.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = batch_margins(processes, controllers)
    for name in NAMES:
        values = getattr(found, name)
        assert not np.any(np.isnan(values))
        assert np.all(values >= 0)
    assert np.all(found.gain[found.stable] > 1)
    assert np.all(found.gain_reduction < 1)
    assert np.all(np.isfinite(found.Ms[found.stable]))


def test_every_corner_of_the_legal_range_agrees_with_the_scalar_on_stability() -> None:
    edge = np.array([1e-9, 1.0, 1e9])
    K, tau, theta, Ti, Td = (
        a.ravel()
        for a in np.meshgrid(edge, edge, np.array([0, 1e-9, 1e9]), [1e-9, 1e9, math.inf], [0, 1e9])
    )
    zero = np.asarray(0)
    found = batch_margins(
        ProcessBatch(K=K, tau1=tau, tau2=zero, integrators=zero, theta=theta),
        PIDBatch(Kc=np.asarray(0.5), Ti=Ti, Td=Td),
    )
    for i in range(0, K.size, 3):
        process = FOPDT(K=K[i], tau=tau[i], theta=theta[i])
        try:
            margins(process, PID(Kc=0.5, Ti=Ti[i], Td=Td[i]))
        except UnstableLoop:
            assert not found.stable[i]
        else:
            assert found.stable[i]


def test_a_batch_without_any_ordinary_loop_is_answered_too() -> None:
    # Positive feedback with K Kc < 1, |L| < 1 everywhere: GM 2, Ms 2, Mt 1, all at w = 0.
    found = batch_margins(ProcessBatch.of(FOPDT(K=-0.5, tau=1, theta=3)), PIDBatch.of(PID(Kc=1)))
    assert (found.gain, found.Ms, found.Mt) == pytest.approx((2, 2, 1))
    assert found.phase == math.inf


@pytest.mark.parametrize("Td", [0.0, 0.5])
def test_integrators_without_any_lag_agree_with_the_scalar(Td: float) -> None:
    Kc, integrators = np.array([[0.2], [0.5], [3.0]]), np.array([1, 2])
    processes = ProcessBatch(
        K=np.ones(()),
        tau1=np.zeros(()),
        tau2=np.zeros(()),
        integrators=integrators,
        theta=np.ones(()),
    )
    found = batch_margins(processes, PIDBatch(Kc=Kc, Ti=np.asarray(20.0), Td=np.asarray(Td)))
    assert found.stable.any()
    for i, j in np.ndindex(3, 2):
        process = TransferFunction((1.0,), (1.0,) + (0.0,) * int(integrators[j]), 1.0)
        try:
            alone = margins(process, PID(Kc=float(Kc[i, 0]), Ti=20.0, Td=Td))
        except UnstableLoop:
            assert not found.stable[i, j]
            continue
        for name in NAMES:
            assert getattr(found, name)[i, j] == pytest.approx(getattr(alone, name), rel=1e-10)
