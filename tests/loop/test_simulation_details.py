"""Valves, anti-windup, filters and manual operation inside the simulated loop."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits, scan_laws
from loop.experiment import Manual, Ramp, Step
from loop.open_loop import process_output
from loop.process import FOPDT, SOPDT, TransferFunction
from loop.response import loop_response
from loop.signals import Real
from loop.simulation import simulate
from loop.simulation_batch import simulate_batch
from loop.valve import Choudhury, DeadBand, He, Kano, Valve, stem_positions
from loop.valve_gain import describing_function

HEATER = FOPDT(K=2, tau=120, theta=30)
PROCESSES = [HEATER, FOPDT(K=1, tau=50, theta=3.7), SOPDT(K=2, tau1=40, tau2=9, theta=0)]
PIDS = [PID(Kc=0.5, Ti=135, Td=13.3), PID(Kc=1.2, Ti=40, tauF=4), PID(Kc=2, Ti=60, Td=6, b=0.4)]


@pytest.mark.parametrize(
    "valve",
    [Choudhury(S=4, J=2), Kano(S=3, J=3), Kano(S=1, J=2), He(fs=2, fd=0.5), DeadBand(width=2)],
)
def test_the_process_is_moved_by_the_stem_and_the_stem_by_the_output(valve: Valve) -> None:
    run = simulate(
        HEATER, PIDS[0], t_end=2000, dt=2, sp=Step(size=8, at=10), valve=valve, pv0=150, op0=40
    )
    whole = stem_positions(valve, run.op - 40, position=0.0) + 40
    np.testing.assert_allclose(run.position, whole, atol=1e-9)
    expected = process_output(HEATER, run.t, run.position, op_before=40, pv0=150)
    np.testing.assert_allclose(run.true_pv, expected, atol=1e-9)
    assert np.max(np.abs(run.position - run.op)) > 0.4


def test_a_valve_without_friction_leaves_everything_as_it_is() -> None:
    plain = simulate(HEATER, PIDS[0], t_end=600, dt=1, sp=3.0)
    same = simulate(HEATER, PIDS[0], t_end=600, dt=1, sp=3.0, valve=Choudhury(S=0, J=0))
    np.testing.assert_array_equal(plain.pv, same.pv)
    np.testing.assert_array_equal(plain.position, plain.op)


def test_a_sticking_valve_cycles_as_its_describing_function_says() -> None:
    """N(A) L(jw) = -1 with half a scan of delay; two lags leave little of the harmonics."""
    S, J, dt = 4.0, 2.0, 0.5
    process, pid = SOPDT(K=1.5, tau1=60, tau2=30, theta=5), PID(Kc=1.5, Ti=40)
    amplitude, w = predicted_cycle(process, pid, S=S, J=J, delay=dt / 2)
    run = simulate(process, pid, t_end=6000, dt=dt, sp=3.0, valve=Choudhury(S=S, J=J))
    last = run.op[-6000:] - run.op[-6000:].mean()
    ups = np.flatnonzero((last[:-1] < 0) & (last[1:] >= 0))
    assert ups.size > 5
    assert np.diff(ups).mean() * dt == pytest.approx(2 * math.pi / w, rel=0.03)
    assert np.ptp(last) / 2 == pytest.approx(amplitude, rel=0.03)


def predicted_cycle(
    process: SOPDT, pid: PID, *, S: float, J: float, delay: float
) -> tuple[float, float]:
    """Amplitude and frequency where N(A) L(jw) = -1, on a fine grid of both."""
    w = np.geomspace(0.005, 0.2, 1500)
    A = S / 2 * np.geomspace(1.001, 20, 1000)
    L = loop_response(process, pid, w) * np.exp(-1j * w * delay)
    distance = np.abs(L[:, None] * describing_function(A, S=S, J=J)[None, :] + 1)
    i, k = np.unravel_index(np.argmin(distance), distance.shape)
    assert distance[i, k] < 0.01
    return float(A[k]), float(w[i])


@settings(max_examples=40, deadline=None)
@given(
    mode=st.sampled_from(AntiWindup),
    valve=st.sampled_from(
        [None, Choudhury(S=0.4, J=0.2), Kano(S=0.3, J=0.5), He(fs=0.4, fd=0.1), DeadBand(width=0.3)]
    ),
    pv_filter=st.sampled_from([0.0, 6.0]),
    manual=st.sampled_from([None, Manual(until=50, op=Ramp(size=0.6, duration=30, at=5))]),
    rate=st.sampled_from([math.inf, 0.05]),
)
def test_a_batch_is_its_loops_one_by_one_in_every_detail(
    mode: AntiWindup, valve: Valve | None, pv_filter: float, manual: Manual | None, rate: float
) -> None:
    experiment = {
        "t_end": 150,
        "dt": 1.3,
        "sp": Step(size=2, at=60),
        "load": Step(size=-0.5, at=20),
        "limits": OutputLimits(low=-1, high=2, rate=rate),
        "anti_windup": mode,
        "valve": valve,
        "pv_filter": pv_filter,
        "manual": manual,
        "op0": 0.5,
    }
    batch = simulate_batch(PROCESSES, PIDS, **experiment)
    for i, (process, pid) in enumerate(zip(PROCESSES, PIDS, strict=True)):
        one = simulate(process, pid, **experiment)
        for name in ("pv", "op", "position", "true_pv"):
            np.testing.assert_allclose(getattr(batch, name)[:, i], getattr(one, name), atol=1e-10)


def test_every_loop_of_a_batch_may_have_its_own_valve() -> None:
    S, J = np.array([0.0, 2.0, 5.0]), np.array([0.0, 2.0, 1.0])
    batch = simulate_batch(
        [HEATER], [PIDS[0]] * 3, t_end=900, dt=2, sp=4.0, valve=Choudhury(S=S, J=J)
    )
    for i in range(3):
        valve = Choudhury(S=float(S[i]), J=float(J[i]))
        one = simulate(HEATER, PIDS[0], t_end=900, dt=2, sp=4.0, valve=valve)
        np.testing.assert_allclose(batch.pv[:, i], one.pv, atol=1e-10)


@pytest.mark.parametrize("pid", [*PIDS, PID(Kc=1.5), PID(Kc=1, Td=5)])
def test_the_velocity_form_adds_changes_to_the_output_that_was_sent(pid: PID) -> None:
    """Second route: the increments of the law, limited and summed, written out here."""
    dt, sp = 2.0, np.where(np.arange(401) < 150, 3.0, -1.0)
    limits = OutputLimits(low=-0.7, high=0.8, rate=0.03)
    run = simulate(
        HEATER, pid, t_end=800, dt=dt, sp=sp, limits=limits, anti_windup=AntiWindup.VELOCITY
    )
    u, F = 0.0, unlimited(pid, sp, run.pv, dt)
    for k, change in enumerate(np.diff(F, prepend=0.0)):
        u = float(np.clip(u + change, u - 0.06, u + 0.06).clip(-0.7, 0.8))
        assert run.op[k] == pytest.approx(u, abs=1e-10)


def unlimited(pid: PID, sp: Real, pv: Real, dt: float) -> Real:
    """Output of the law without limits for a measured PV, by filters over whole signals."""
    law = scan_laws([pid], dt, anti_windup=AntiWindup.NONE, Tt=None)
    kP, kI, kD, dD, b, c, dF, f0, f1, _ = (float(a[0]) for a in law.arrays())
    r_old, m_old = np.append(0.0, sp[:-1]), np.append(0.0, pv[:-1])
    integral = kI * np.cumsum(r_old - (pv + m_old) / 2)
    derivative, v, F = 0.0, np.zeros(sp.size), np.zeros(sp.size)
    for k in range(sp.size):
        before = c * r_old[k] - m_old[k]
        derivative = dD * derivative + kD * (c * sp[k] - pv[k] - before)
        v[k] = kP * (b * sp[k] - pv[k]) + integral[k] + derivative
        F[k] = (dF * F[k - 1] + f1 * v[k - 1] if k else 0.0) + f0 * v[k]
    return F


def test_tracking_is_the_velocity_form_where_there_is_an_integral() -> None:
    limits = OutputLimits(low=-0.7, high=0.8)
    both = [
        simulate_batch(PROCESSES, PIDS, t_end=400, dt=1, sp=3.0, limits=limits, anti_windup=mode)
        for mode in (AntiWindup.TRACKING, AntiWindup.VELOCITY)
    ]
    np.testing.assert_array_equal(both[0].op, both[1].op)


def test_proportional_control_in_velocity_form_drifts_after_a_limit() -> None:
    """Positional P goes back to Kc e; the velocity form keeps the part that the limit cut off."""
    sp = np.where(np.arange(2001) < 200, 4.0, 0.0)
    runs = {
        mode: simulate(
            FOPDT(K=1, tau=10, theta=0),
            PID(Kc=1),
            t_end=2000,
            dt=1,
            sp=sp,
            limits=OutputLimits(low=-9, high=1),
            anti_windup=mode,
        )
        for mode in (AntiWindup.TRACKING, AntiWindup.VELOCITY)
    }
    assert runs[AntiWindup.TRACKING].op[-1] == pytest.approx(0, abs=1e-9)
    # Up: 1 of 4 arrives, then u = 1 - pv = pv = 1/2. Down: u = 1/2 - 4 + (1/2 - pv) = pv = -3/2.
    assert runs[AntiWindup.VELOCITY].op[-1] == pytest.approx(-1.5, abs=1e-9)


def test_tracking_by_hand() -> None:
    """K = 0: e = 5 for good, limit 3. Every scan v = 3 + Kc e dt/Ti; the drop takes Kc 5 = 10."""
    sp = np.full(201, 5.0)
    sp[-1] = 0.0
    run = simulate(
        FOPDT(K=1e-9, tau=10, theta=0),
        PID(Kc=2, Ti=20),
        t_end=20,
        dt=0.1,
        sp=sp,
        limits=OutputLimits(low=-30, high=3),
        anti_windup=AntiWindup.TRACKING,
    )
    assert np.all(run.op[:-1] == 3)
    assert run.op[-1] == pytest.approx(3 + 2 * 5 * 0.1 / 20 - 10, abs=1e-7)


def test_a_filter_of_pv_is_a_lag_of_the_controller_for_loads() -> None:
    """Both are linear and the set point rests, so their order does not matter."""
    pid = PID(Kc=0.5, Ti=135, Td=13.3)
    lagged = PID(Kc=0.5, Ti=135, Td=13.3, tauF=9)
    a = simulate(HEATER, pid, t_end=900, dt=2, load=3.0, pv_filter=9)
    b = simulate(HEATER, lagged, t_end=900, dt=2, load=3.0)
    np.testing.assert_allclose(a.pv, b.pv, atol=1e-12)
    c = simulate(HEATER, pid, t_end=900, dt=2, sp=3.0, pv_filter=9)
    assert c.op[0] == 1.5  # the set point is not filtered


@pytest.mark.parametrize("pid", PIDS)
def test_the_transfer_to_automatic_has_no_bump(pid: PID) -> None:
    """PV rests at the set point when the law takes over: nothing moves, whatever came before."""
    process = FOPDT(K=2, tau=12, theta=3)
    rest = 150 + 2 * 7.3
    manual = Manual(until=800, op=Step(size=7.3, at=20))
    run = simulate(process, pid, t_end=1000, dt=1, sp=rest, pv0=150, op0=40, manual=manual)
    assert run.op[19:22].tolist() == [40, 47.3, 47.3]
    assert np.max(np.abs(run.op[800:] - 47.3)) < 1e-9
    assert np.max(np.abs(run.pv[800:] - rest)) < 1e-9


@pytest.mark.parametrize("pid", [PID(Kc=0.9, Ti=60), PID(Kc=0.9, Ti=60, Td=8, b=0.3)])
def test_an_error_at_the_transfer_moves_the_output_by_one_scan_of_integral_only(pid: PID) -> None:
    process = FOPDT(K=2, tau=12, theta=3)
    run = simulate(process, pid, t_end=820, dt=1, sp=160.0, pv0=150, manual=Manual(until=800))
    assert run.op[800] - run.op[799] == pytest.approx(0.9 * 10 / 60, abs=1e-9)
    batch = simulate_batch(
        [process], [pid], t_end=820, dt=1, sp=160.0, pv0=150, manual=Manual(until=800)
    )
    np.testing.assert_allclose(batch.op[:, 0], run.op, atol=1e-10)


def test_manual_needs_a_sensible_output() -> None:
    with pytest.raises(ValueError, match="until must be positive"):
        Manual(until=0)
    with pytest.raises(ValueError, match=r"op in manual must have the shape \(11,\)"):
        simulate(HEATER, PIDS[0], t_end=10, dt=1, manual=Manual(until=5, op=np.zeros(3)))
    with pytest.raises(ValueError, match="must lie within the limits 0 and 100, got -2"):
        simulate(
            HEATER,
            PIDS[0],
            t_end=10,
            dt=1,
            limits=OutputLimits(low=0, high=100),
            manual=Manual(until=5, op=-2.0),
        )
    with pytest.raises(ValueError, match="pv_filter must be 0 or positive"):
        simulate(HEATER, PIDS[0], t_end=10, dt=1, pv_filter=-1)


@pytest.mark.parametrize(
    ("pid", "pv_filter"),
    [
        (PIDS[0], 0.0),
        (PIDS[1], 0.0),
        (PIDS[2], 5.0),
        (PID(Kc=0.4, Ti=90, Td=9, c=0.5, tauF=3), 2.0),
    ],
)
@pytest.mark.parametrize(
    "process", [HEATER, SOPDT(K=2, tau1=80, tau2=20, theta=8), TransferFunction((1,), (9, 6, 1), 4)]
)
def test_without_limits_python_control_finds_the_same_loop(
    process: FOPDT | SOPDT | TransferFunction, pid: PID, pv_filter: float
) -> None:
    """Sampled process and law as discrete state spaces, closed by python-control."""
    dt, n = 2.0, 300
    z = control.tf("z")
    z.dt = dt
    law = scan_laws([pid], dt, anti_windup=AntiWindup.NONE, Tt=None)
    kP, kI, kD, dD, b, c, dF, f0, f1, _ = (float(a[0]) for a in law.arrays())
    lag = (f0 * z + f1) / (z - dF)
    rate = kD * (z - 1) / (z - dD)
    from_sp = lag * (kP * b + kI / (z - 1) + c * rate)
    smoothing = control.tf(1, 1, dt)
    if pv_filter:
        decay = math.exp(-dt / pv_filter)
        part = (1 - decay) * pv_filter / dt
        smoothing = ((1 - part) * z + part - decay) / (z - decay)
    from_pv = smoothing * lag * (kP + kI / 2 * (z + 1) / (z - 1) + rate)
    lags = np.polymul((process.tau1, 1), (process.tau2, 1)) if isinstance(process, SOPDT) else None
    denominator = (process.tau, 1) if isinstance(process, FOPDT) else lags
    rational = (
        control.tf(process.numerator, process.denominator)
        if isinstance(process, TransferFunction)
        else control.tf([process.K], denominator)
    )
    held = control.sample_system(control.ss(rational), dt, "zoh")
    delay = control.ss(z ** -round(process.theta / dt))
    plant = delay * held
    loop = control.feedback(plant, control.ss(from_pv)) * control.ss(from_sp)
    loads = control.feedback(plant, control.ss(from_pv))
    t = np.arange(n + 1) * dt
    r, push = np.where(t >= 10, 3.0, 0.0), np.where(t >= 250, -0.5, 0.0)
    expected = (
        control.forced_response(loop, t, r).outputs
        + control.forced_response(loads, t, push).outputs
    )
    run = simulate(process, pid, t_end=n * dt, dt=dt, sp=r, load=push, pv_filter=pv_filter)
    np.testing.assert_allclose(run.pv, expected, atol=1e-6)
