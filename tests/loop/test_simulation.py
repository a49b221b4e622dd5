"""Closed-loop simulation against a continuous solution, printed anchors and hand-checked cases."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from loop.controller import PID, Action
from loop.digital_pid import AntiWindup, OutputLimits, tracking_time
from loop.errors import LoopDiverged
from loop.experiment import Ramp, Step
from loop.process import FOPDT, IPDT, TransferFunction
from loop.signals import Real
from loop.simulation import Response, simulate

HEATER = FOPDT(K=2, tau=120, theta=30)
HEATER_PID = PID(Kc=0.5, Ti=135, Td=13.3)
T = np.arange(0, 601, 8.0)


def continuous(
    process: FOPDT, pid: PID, *, sp: float = 0.0, load: float = 0.0, extra: float = 0.0
) -> Real:
    """Second route: the continuous loop by the method of steps, `extra` delay in the controller.

    States: PV, integral, filtered PV, lagged output. The answer of every stretch of one delay is
    the delayed input of the next.
    """
    delay, answer, x = process.theta + extra, np.zeros(T.size), np.zeros(4)
    before: Callable[[float], Real] = at_rest(pid, sp)

    def output(x: Real) -> float:
        if pid.tauF:
            return float(x[3])
        return float(pid.Kc * (pid.b * sp - x[0] - pid.N * (x[0] - x[2])) + x[1])

    def rates(t: float, x: Real) -> list[float]:
        u = output(before(t - delay))
        v = pid.Kc * (pid.b * sp - x[0] - pid.N * (x[0] - x[2])) + x[1]
        return [
            (process.K * (u + (load if t >= process.theta else 0.0)) - x[0]) / process.tau,
            pid.Kc * (sp - x[0]) / pid.Ti,
            (x[0] - x[2]) / pid.filter_time,
            (v - x[3]) / pid.tauF if pid.tauF else 0.0,
        ]

    for k in range(math.ceil(T[-1] / delay)):
        # The load arrives at theta, within the first stretch when there is extra delay.
        cuts = [process.theta, delay] if k == 0 and extra else [(k + 1) * delay]
        arcs, first = [], k * delay
        for last in cuts:
            run = solve_ivp(
                rates, (first, last), x, "DOP853", dense_output=True, rtol=1e-10, atol=1e-12
            )
            assert run.sol is not None
            inside = (first <= T) & (last >= T)
            if np.any(inside):
                answer[inside] = run.sol(T[inside])[0]
            arcs.append((last, run.sol))
            first, x = last, run.y[:, -1]
        before = joined(arcs)
    return answer


def at_rest(pid: PID, sp: float) -> Callable[[float], Real]:
    """States that give no output before the set point moves."""
    return lambda _: np.array([0.0, -pid.Kc * pid.b * sp, 0.0, 0.0])


def joined(arcs: list[tuple[float, Callable[[float], Real]]]) -> Callable[[float], Real]:
    return lambda t: next((arc for last, arc in arcs if t <= last), arcs[-1][1])(t)


def at_scans(response: Response, dt: float) -> Real:
    return np.asarray(response.pv[np.round(T / dt).astype(int)])


@pytest.mark.parametrize("pid", [HEATER_PID, PID(Kc=0.45, Ti=135, Td=13.3, tauF=12, b=0.6)])
def test_the_digital_loop_converges_to_the_continuous_one(pid: PID) -> None:
    exact = continuous(HEATER, pid, sp=1.0)
    error = {
        dt: np.abs(at_scans(simulate(HEATER, pid, t_end=600, dt=dt, sp=1.0), dt) - exact).max()
        for dt in (1.0, 0.5, 0.05)
    }
    assert error[0.05] < 5e-5
    assert error[1.0] / error[0.5] == pytest.approx(2, abs=0.05)  # first order: the hold


@pytest.mark.parametrize("pid", [HEATER_PID, PID(Kc=0.45, Ti=135, Td=13.3, tauF=12)])
def test_a_scan_adds_the_delay_of_its_hold_and_nothing_else(pid: PID) -> None:
    """Against a continuous loop with half a scan more dead time the error is of second order."""
    error = []
    for dt in (1.0, 0.5):
        found = at_scans(simulate(HEATER, pid, t_end=600, dt=dt, load=1.0), dt)
        error.append(np.abs(found - continuous(HEATER, pid, load=1.0, extra=dt / 2)).max())
    assert error[0] < 2e-4
    assert error[0] / error[1] == pytest.approx(4, abs=0.2)


@pytest.mark.parametrize(
    ("Kc", "tauF", "seconds"), [(0.5, 0, 343), (0.45, 12, 359), (0.45, 0, 390)]
)
def test_the_heater_reaches_95_percent_when_the_anchor_says(
    Kc: float, tauF: float, seconds: float
) -> None:
    pid = PID(Kc=Kc, Ti=135, Td=13.3, tauF=tauF)
    response = simulate(HEATER, pid, t_end=500, dt=0.1, sp=1.0)
    assert response.t[np.argmax(response.pv > 0.95)] == pytest.approx(seconds, abs=0.5)


def motor_response(t: float) -> float:
    """Closed form for L = e^(-theta s)/(T s): sum (-1)^(n+1) ((t - n theta)/T)^n/n!"""
    T, theta = 0.0175, 0.005
    return sum(
        (-1.0) ** (n + 1) * ((t - n * theta) / T) ** n / math.factorial(n)
        for n in range(1, math.ceil(t / theta))
    )


def test_the_motor_reaches_95_percent_and_settles_when_the_anchor_says() -> None:
    """Printed: 40.1 ms and 50.4 ms; the closed form says 40.17 ms and 50.43 ms."""
    motor, Kc = FOPDT(K=100, tau=0.05, theta=0.005), 0.05 / (100 * 0.0175)
    response = simulate(motor, PID(Kc=Kc, Ti=0.05), t_end=0.1, dt=1e-5, sp=1.0)
    exact = [motor_response(t) for t in response.t]
    np.testing.assert_allclose(response.pv, exact, atol=3e-4)
    assert response.t[np.argmax(response.pv > 0.95)] == pytest.approx(0.0401, abs=1e-4)
    outside = np.abs(response.pv - 1) > 0.02
    assert response.t[outside.nonzero()[0][-1]] == pytest.approx(0.0504, abs=5e-5)


def test_tyreus_luyben_on_an_integrator_overshoots_by_a_quarter() -> None:
    Ku, Pu = math.pi / 2, 4.0
    pid = PID(Kc=Ku / 3.22, Ti=2.2 * Pu)
    response = simulate(IPDT(K=1, theta=1), pid, t_end=60, dt=0.01, sp=1.0)
    assert 100 * (response.pv.max() - 1) == pytest.approx(25, abs=0.5)


def test_the_ultimate_gain_cycles_with_the_ultimate_period() -> None:
    """Ku 3.467 and Pu 109.9 s of the heater: neither growing nor dying (facts.md section 3)."""
    pv = simulate(HEATER, PID(Kc=3.467), t_end=2000, dt=0.05, load=1.0).pv
    swing = pv[20_000:] - pv[20_000:].mean()
    up = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0)) * 0.05
    assert np.diff(up).mean() == pytest.approx(109.9, abs=0.1)
    assert swing[-2500:].max() / swing[:2500].max() == pytest.approx(1, abs=0.02)


def test_no_controller_gets_below_the_dead_time_bound_of_a_load() -> None:
    """A 10 % load at the heater input moves PV by 2 x 10 (1 - e^(-30/120)) = 4.42 degC."""
    for pid in (HEATER_PID, PID(Kc=2, Ti=60, Td=10), PID(Kc=3.2, Ti=500)):
        response = simulate(HEATER, pid, t_end=300, dt=0.5, load=10.0)
        assert response.pv.max() >= 4.42
    blind = simulate(HEATER, PID(Kc=1e-9), t_end=60, dt=0.5, load=10.0)
    assert blind.pv[-1] == pytest.approx(4.42, abs=0.005)


def test_the_direct_action_mirrors_the_reverse_one() -> None:
    cooler = FOPDT(K=-2, tau=120, theta=30)
    direct = PID(Kc=0.5, Ti=135, Td=13.3, action=Action.DIRECT)
    a = simulate(HEATER, HEATER_PID, t_end=600, dt=1, sp=1.0, load=0.3)
    b = simulate(cooler, direct, t_end=600, dt=1, sp=1.0, load=-0.3)
    np.testing.assert_allclose(b.pv, a.pv, atol=1e-12)
    np.testing.assert_allclose(b.op, -a.op, atol=1e-12)


def test_a_loop_starts_at_rest_and_stays_there() -> None:
    pid = PID(Kc=2, Ti=10, Td=1, b=0.5, c=1, tauF=3)
    response = simulate(HEATER, pid, t_end=100, dt=1, pv0=63, op0=41)
    assert np.all(response.pv == 63)
    assert np.all(response.op == 41)
    assert np.all(response.sp == 63)


def test_set_point_weights_shape_the_first_move() -> None:
    def first_move(**weights: float) -> float:
        pid = PID(Kc=2, Ti=100, Td=10, N=5, **weights)
        return float(simulate(HEATER, pid, t_end=1, dt=0.001, sp=1.0).op[0])

    assert first_move() == pytest.approx(2)
    assert first_move(b=0.3) == pytest.approx(0.6)
    assert first_move(b=0) == 0
    assert first_move(c=1) == pytest.approx(2 * (1 + 5), rel=1e-3)  # Kc (1 + N)


def test_loads_ramps_and_arrays_arrive_where_they_are_said_to() -> None:
    asleep = PID(Kc=1e-9)
    ramp = Ramp(size=4, at=10, duration=20)
    response = simulate(
        HEATER, asleep, t_end=100, dt=1, sp=ramp, output_load=Step(size=3, at=50), pv0=5
    )
    np.testing.assert_allclose(response.sp[[0, 10, 20, 30, 100]], [5, 5, 7, 9, 9])
    np.testing.assert_allclose(response.pv[[49, 50]], [5, 8], atol=1e-6)
    load = simulate(HEATER, asleep, t_end=100, dt=1, load=Step(size=1, at=20))
    array = simulate(HEATER, asleep, t_end=100, dt=1, load=np.where(load.t >= 20, 1.0, 0.0))
    assert np.all(load.pv[:51] == 0)
    np.testing.assert_allclose(load.pv[51:], 2 * (1 - np.exp(-(load.t[51:] - 50) / 120)), atol=1e-6)
    np.testing.assert_array_equal(load.pv, array.pv)


def test_limits_and_rate_hold_everywhere() -> None:
    limits = OutputLimits(low=-0.2, high=1.5, rate=0.05)
    sp = np.where(np.arange(1801) < 900, 2.0, -0.5)
    response = simulate(HEATER, PID(Kc=3, Ti=60, Td=15), t_end=900, dt=0.5, sp=sp, limits=limits)
    moves = np.diff(response.op, prepend=0.0)
    assert (response.op.min(), response.op.max()) == (-0.2, 1.5)
    assert (moves.min(), moves.max()) == pytest.approx((-0.025, 0.025), abs=1e-12)


PI = PID(Kc=2, Ti=20)
STUCK = FOPDT(K=1e-9, tau=10, theta=0)


def test_back_calculation_rests_where_the_hand_calculation_says() -> None:
    """0 = Kc e/Ti + (u_sat - v)/Tt, so v rests at u_sat + Kc e Tt/Ti = 3 + 2 x 5 x 10/20 = 8."""
    sp = np.full(2001, 5.0)
    sp[-1] = 0.0
    response = simulate(
        STUCK, PI, t_end=200, dt=0.1, sp=sp, limits=OutputLimits(low=-3, high=3), Tt=10
    )
    # v = 8 while e = 5; when the set point drops by 5, v drops by Kc 5 = 10 at once.
    assert response.op[-2] == 3
    assert response.op[-1] == pytest.approx(8 - 10, abs=0.06)


def test_with_the_sign_reversed_the_output_would_latch() -> None:
    """The same case with (v - u_sat)/Tt, written out here: the integral runs away."""
    right = wrong = 0.0
    for _ in range(2000):
        for sign in (1, -1):
            v = 2 * 5 + (right if sign == 1 else wrong)
            change = 0.1 * (2 * 5 / 20 + sign * (min(v, 3) - v) / 10)
            right, wrong = (right + change, wrong) if sign == 1 else (right, wrong + change)
    assert 10 + right == pytest.approx(8, abs=1e-6)
    assert wrong > 1e6
    response = simulate(
        FOPDT(K=1, tau=10, theta=0),
        PI,
        t_end=200,
        dt=0.1,
        sp=Step(size=5),
        output_load=Step(size=5, at=100),
        limits=OutputLimits(low=-3, high=3),
        Tt=10,
    )
    assert response.op[999] == 3
    assert response.op[-1] < 1  # the modelled controller came back; the reversed one cannot


def test_clamping_holds_the_integral_and_no_anti_windup_lets_it_grow() -> None:
    sp = np.full(2001, 5.0)
    sp[-1] = 0.0
    last = {
        mode: simulate(
            STUCK,
            PI,
            t_end=200,
            dt=0.1,
            sp=sp,
            limits=OutputLimits(low=-300, high=3),
            anti_windup=mode,
        ).op[-1]
        for mode in AntiWindup
    }
    # Clamped at once, v = Kc e = 10 > 3: only the last scan adds its Kc e dt/Ti = 0.05.
    assert last[AntiWindup.CLAMPING] == pytest.approx(0.05, abs=1e-6)
    # Never held: the integral of Kc e/Ti over 200 s is 100, far above the limit.
    assert last[AntiWindup.NONE] == 3
    # Default Tt of a PI is Ti: v = 3 + 2 x 5 = 13, minus 10.
    assert last[AntiWindup.BACK_CALCULATION] == pytest.approx(3, abs=0.06)


@pytest.mark.parametrize("mode", [AntiWindup.CLAMPING, AntiWindup.BACK_CALCULATION])
def test_anti_windup_overshoots_less_than_none(mode: AntiWindup) -> None:
    def peak(mode: AntiWindup) -> float:
        limits = OutputLimits(low=0, high=0.63)
        response = simulate(
            HEATER, PID(Kc=1.5, Ti=135), t_end=1500, dt=1, sp=1.2, limits=limits, anti_windup=mode
        )
        return float(response.pv.max())

    assert peak(mode) < peak(AntiWindup.NONE) - 0.02


def test_the_tracking_time_is_the_published_default() -> None:
    assert tracking_time(PID(Kc=1, Ti=16, Td=4)) == 8
    assert tracking_time(PID(Kc=1, Ti=16)) == 16
    assert tracking_time(PID(Kc=1)) == math.inf


def test_a_proportional_controller_has_no_integral_to_track() -> None:
    response = simulate(
        HEATER, PID(Kc=3), t_end=3000, dt=1, sp=1.0, limits=OutputLimits(low=-1, high=1)
    )
    assert response.pv[-1] == pytest.approx(2 * 3 / (1 + 2 * 3), abs=1e-3)  # K Kc/(1 + K Kc)


def test_noise_reaches_the_sensor_and_not_the_plant_at_once() -> None:
    rng = np.random.default_rng(5)
    noisy = simulate(HEATER, HEATER_PID, t_end=2000, dt=1, noise=0.1, rng=rng)
    again = simulate(
        HEATER, HEATER_PID, t_end=2000, dt=1, noise=noisy.pv - noisy.true_pv, resolution=0
    )
    assert np.std(noisy.pv - noisy.true_pv) == pytest.approx(0.1, rel=0.05)
    assert np.std(noisy.true_pv) < 0.03
    np.testing.assert_allclose(again.pv, noisy.pv, atol=1e-12)


def test_a_coarse_sensor_shows_multiples_of_its_resolution() -> None:
    response = simulate(HEATER, HEATER_PID, t_end=600, dt=1, sp=64.0, pv0=63.0, resolution=0.25)
    np.testing.assert_array_equal(np.round(response.pv / 0.25) * 0.25, response.pv)
    assert np.abs(response.pv - response.true_pv).max() <= 0.125 + 1e-12
    assert np.unique(response.pv).size > 3


def test_a_plant_of_higher_order_runs_by_the_same_law() -> None:
    """(s + 1) over itself cancels, so a third-order form must answer as the first-order one."""
    same = TransferFunction((2.0, 4.0, 2.0), tuple(np.polymul((120, 1), (1, 2, 1))), 30)
    a = simulate(HEATER, HEATER_PID, t_end=600, dt=1, sp=1.0, load=0.2)
    b = simulate(same, HEATER_PID, t_end=600, dt=1, sp=1.0, load=0.2)
    np.testing.assert_allclose(b.pv, a.pv, atol=1e-9)


def test_a_plant_that_answers_at_once_is_read_before_the_output_moves() -> None:
    gain = TransferFunction((0.5,), (1.0,))
    response = simulate(gain, PID(Kc=1, Ti=2), t_end=40, dt=0.1, sp=1.0)
    assert response.pv[0] == 0
    assert response.pv[1] == pytest.approx(0.5 * response.op[0])
    assert response.pv[-1] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    "process", [HEATER, TransferFunction((2.0,), tuple(np.polymul((120, 1), (4, 4, 1))), 30)]
)
def test_a_loop_that_grows_without_bound_says_when(process: FOPDT | TransferFunction) -> None:
    with pytest.raises(LoopDiverged, match="grows without bound") as caught:
        simulate(process, PID(Kc=50, Ti=10), t_end=10_000, dt=5, sp=1.0)
    assert 0 < caught.value.time < 10_000


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"dt": 0}, "dt must be positive"),
        ({"t_end": 0.5}, "t_end must be at least"),
        ({"t_end": math.inf}, "t_end must be at least"),
        ({"t_end": 1e9}, "scans are more than"),
        ({"pv0": math.nan}, "must be finite"),
        ({"limits": OutputLimits(low=10, high=20)}, "op0 must lie within"),
        ({"resolution": -1}, "resolution must be"),
        ({"Tt": 0}, "Tt must be positive"),
        ({"sp": np.zeros(3)}, r"sp must have the shape \(11,\), got \(3,\)"),
        ({"load": np.zeros((11, 2))}, r"load must have the shape \(11,\), got \(11, 2\)"),
        ({"load": math.inf}, "load must be finite"),
        ({"sp": Step(size=math.nan)}, "sp must be finite"),
        ({"noise": 0.1}, "noise needs rng"),
        ({"noise": -0.1}, "noise must be 0 or"),
    ],
)
def test_impossible_experiments_are_refused_in_words(
    settings: dict[str, float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        simulate(HEATER, HEATER_PID, **{"t_end": 10.0, "dt": 1.0, **settings})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: OutputLimits(low=1, high=1), "low must be below high"),
        (lambda: OutputLimits(rate=0), "rate must be positive"),
        (lambda: Ramp(size=1, duration=0), "duration must be positive"),
    ],
)
def test_impossible_limits_and_ramps_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()
