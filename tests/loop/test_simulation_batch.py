"""Many loops at once must be the same law as one loop."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID, Action
from loop.digital_pid import AntiWindup, OutputLimits
from loop.experiment import Step
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from loop.simulation import simulate
from loop.simulation_batch import simulate_batch

unit = st.floats(0.1, 1)
processes = st.one_of(
    st.builds(lambda K, a, b: FOPDT(K=4 * K, tau=50 * a, theta=20 * b), unit, unit, unit),
    st.builds(lambda K, a, b: SOPDT(K=K, tau1=50 * a, tau2=50 * a * b, theta=0), unit, unit, unit),
    st.builds(lambda K, a: IPDT(K=0.1 * K, theta=10 * a), unit, unit),
    st.builds(lambda K: TransferFunction((-1.0, K), (5.0, 6.0, K), 1.7), unit),
    st.builds(lambda K: TransferFunction((-0.2, K), (5.0, 1.0), 2.8), unit),
)
controllers = st.builds(
    lambda Kc, Ti, Td, N, b, c, tauF: PID(
        Kc=Kc, Ti=100 * Ti, Td=5 * Td, N=10 * N, b=b, c=c, tauF=tauF
    ),
    unit,
    unit,
    st.sampled_from([0, 1, 2]),
    unit,
    unit,
    st.sampled_from([0, 1]),
    st.sampled_from([0, 3.0]),
)


@settings(max_examples=30, deadline=None)
@given(
    loops=st.lists(st.tuples(processes, controllers), min_size=1, max_size=4),
    mode=st.sampled_from(AntiWindup),
    rate=st.sampled_from([np.inf, 0.3]),
    seed=st.integers(0, 100),
)
def test_a_batch_is_its_loops_one_by_one(
    loops: list[tuple[Process, PID]], mode: AntiWindup, rate: float, seed: int
) -> None:
    experiment = {
        "t_end": 80,
        "dt": 0.7,
        "sp": Step(size=2, at=3),
        "load": Step(size=0.5, at=40),
        "noise": np.random.default_rng(seed).normal(0, 0.01, 115),
        "limits": OutputLimits(low=-2, high=3, rate=rate),
        "anti_windup": mode,
        "pv0": 1.0,
        "op0": 0.5,
    }
    batch = simulate_batch(*zip(*loops, strict=True), **experiment)
    assert not np.any(batch.diverged)
    for i, (process, pid) in enumerate(loops):
        one = simulate(process, pid, **experiment)
        np.testing.assert_allclose(batch.pv[:, i], one.pv, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(batch.op[:, i], one.op, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(batch.true_pv[:, i], one.true_pv, rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(batch.sp, one.sp)


def test_one_process_serves_many_controllers_and_the_other_way_round() -> None:
    heater, pid = FOPDT(K=2, tau=120, theta=30), PID(Kc=0.5, Ti=135, Td=13.3)
    gains = [0.2, 0.5, 0.8]
    by_gain = simulate_batch(
        [heater], [PID(Kc=g, Ti=135) for g in gains], t_end=500, dt=1, resolution=0.1, sp=1.0
    )
    one = simulate(heater, PID(Kc=0.8, Ti=135), t_end=500, dt=1, resolution=0.1, sp=1.0)
    np.testing.assert_allclose(by_gain.pv[:, 2], one.pv, atol=1e-12)
    plants = simulate_batch([heater, FOPDT(K=1, tau=120, theta=3)], [pid], t_end=500, dt=1, sp=1.0)
    assert plants.pv.shape == (501, 2)


def test_every_loop_may_have_its_own_signals() -> None:
    integrator = DoubleIntegrator(K=0.01, theta=1)
    pid = PID(Kc=1, Td=20)
    t = np.arange(201.0)
    sp = np.stack([np.where(t > 5, size, 0.0) for size in (1.0, 2.0)], axis=1)
    batch = simulate_batch([integrator], [pid, pid], t_end=200, dt=1, sp=sp)
    np.testing.assert_allclose(batch.pv[:, 1], 2 * batch.pv[:, 0], atol=1e-9)
    noise = simulate_batch(
        [integrator], [pid, pid], t_end=200, dt=1, noise=0.1, rng=np.random.default_rng(1)
    )
    sensors = noise.pv - noise.true_pv
    assert abs(np.mean(sensors[:, 0] * sensors[:, 1])) < 0.2 * 0.1**2


def test_a_diverging_loop_is_marked_and_leaves_the_others_alone() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)
    pids = [
        PID(Kc=0.5, Ti=135),
        PID(Kc=50, Ti=10),
        PID(Kc=0.5, Ti=135, action=Action.DIRECT),
    ]
    batch = simulate_batch([heater], pids, t_end=40_000, dt=10, sp=1.0)
    np.testing.assert_array_equal(batch.diverged, [False, True, True])
    alone = simulate(heater, pids[0], t_end=40_000, dt=10, sp=1.0)
    np.testing.assert_allclose(batch.pv[:, 0], alone.pv, atol=1e-12)
    assert np.all(np.abs(batch.pv) <= 1e30)


def test_lengths_that_make_no_pairs_are_refused() -> None:
    heater, pid = FOPDT(K=2, tau=120, theta=30), PID(Kc=0.5)
    for plants, pids in ([heater] * 2, [pid] * 3), ([], [pid]), ([heater], []):
        with pytest.raises(ValueError, match="do not make pairs"):
            simulate_batch(plants, pids, t_end=10, dt=1)


@pytest.mark.parametrize("mode", AntiWindup)
def test_batches_of_arrays_are_their_loops_one_by_one(mode: AntiWindup) -> None:
    """Every structure a ProcessBatch can hold, against the scalar model of the same numbers."""
    tau1, tau2, integrators = np.array(
        [(0, 0, 0), (9, 0, 0), (0, 4, 0), (9, 4, 0), (0, 0, 1), (9, 0, 1), (9, 4, 2), (0, 0, 2)]
    ).T
    theta = np.array([0.0, 0.3, 1.0, 2.9, 0.0, 1.5, 0.7, 2.0])
    processes = ProcessBatch(np.asarray(0.02), tau1, tau2, integrators, theta)
    controllers = PIDBatch(
        Kc=np.array([[0.6], [1.2]]), Ti=np.array([[40.0], [np.inf]]), Td=np.array([[0.0], [3.0]])
    )
    experiment = {
        "t_end": 60,
        "dt": 0.7,
        "sp": 1.0,
        "load": Step(size=2, at=20),
        "anti_windup": mode,
    }
    limits = OutputLimits(low=-0.9, high=0.9, rate=0.5)
    batch = simulate_batch(processes, controllers, limits=limits, **experiment)
    assert batch.pv.shape == (86, 16)
    for i in range(16):
        row, column = divmod(i, 8)
        lags = np.polymul((tau1[column], 1), (tau2[column], 1))
        denominator = np.append(lags, np.zeros(integrators[column]))
        process = TransferFunction((0.02,), tuple(denominator), theta[column])
        pid = [PID(Kc=0.6, Ti=40), PID(Kc=1.2, Td=3)][row]
        one = simulate(process, pid, limits=limits, **experiment)
        np.testing.assert_allclose(batch.pv[:, i], one.pv, atol=1e-11)
        np.testing.assert_allclose(batch.op[:, i], one.op, atol=1e-11)


def test_a_batch_of_arrays_meets_a_list_of_models() -> None:
    heater, pid = FOPDT(K=2, tau=120, theta=30), PID(Kc=0.5, Ti=135, Td=13.3)
    swept = ProcessBatch.of(heater).scaled(K=np.array([0.5, 1.0, 1.5]))
    a = simulate_batch(swept, [pid], t_end=300, dt=1, sp=1.0)
    b = simulate_batch(
        [heater],
        PIDBatch(Kc=0.5 * np.array([0.5, 1.0, 1.5]), Ti=np.asarray(135.0), Td=np.asarray(13.3)),
        t_end=300,
        dt=1,
        sp=1.0,
    )
    np.testing.assert_allclose(a.pv, b.pv, atol=1e-12)  # only the product K Kc counts
    one = simulate(heater, pid, t_end=300, dt=1, sp=1.0)
    np.testing.assert_allclose(a.pv[:, 1], one.pv, atol=1e-12)


def test_a_batch_that_would_fill_the_memory_is_refused() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)
    with pytest.raises(ValueError, match="100001 scans of 1000 loops are more than 50,000,000"):
        simulate_batch([heater], [PID(Kc=0.5)] * 1000, t_end=1e5, dt=1)


def test_signals_that_do_not_fit_the_batch_are_refused() -> None:
    heater, pid = FOPDT(K=2, tau=120, theta=30), PID(Kc=0.5)
    with pytest.raises(ValueError, match=r"load must have the shape \(11,\) or \(11, 2\)"):
        simulate_batch([heater], [pid] * 2, t_end=10, dt=1, load=np.zeros((11, 3)))


def test_loops_die_out_below_their_gain_margin_and_grow_above_it() -> None:
    """Second route for the margins, the hold of the scan included."""
    rng = np.random.default_rng(7)
    processes, controllers = [], []
    for tau, theta, Ti, Td in rng.uniform([20, 5, 0.8, 0], [100, 20, 2, 0.5], (12, 4)):
        process = FOPDT(K=2, tau=tau, theta=theta)
        pid = PID(Kc=0.3 * tau / theta, Ti=Ti * tau, Td=Td * theta)
        limit = margins(process, pid, sample_time=0.1).gain
        for part in (0.96, 1.04):
            processes.append(process)
            controllers.append(replace(pid, Kc=part * limit * pid.Kc))
    batch = simulate_batch(processes, controllers, t_end=1500, dt=0.1, load=1.0)
    swing = batch.pv - batch.pv.mean(axis=0)
    early, late = (np.ptp(swing[a:b], axis=0) for a, b in ((2000, 6000), (11000, 15000)))
    assert np.all(late[::2] < 0.8 * early[::2])
    assert np.all(late[1::2] > 1.25 * early[1::2])
