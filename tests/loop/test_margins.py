import math
import warnings

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.controller import PID, Action, SeriesPID
from loop.crossovers import gain_cuts
from loop.errors import INFINITELY_MANY, UnstableLoop
from loop.factors import FactoredLoop
from loop.lti import controller_to_control, to_control
from loop.margins import Margins, margins
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from loop.response import complementary_sensitivity, sensitivity
from loop.stability import unstable_poles

HEATER = FOPDT(K=2, tau=120, theta=30)
HEATER_PID = PID(Kc=0.45, Ti=135, Td=13.3)


def wc(process: Process, controller: PID) -> float:
    return float(gain_cuts(FactoredLoop.of(process, controller)).wc[-1])


def assert_printed(found: Margins, **printed: str) -> None:
    """Every value agrees with its printed form to the last printed digit."""
    for name, text in printed.items():
        digits = len(text.partition(".")[2])
        assert f"{getattr(found, name):.{digits}f}" == text, name


def test_heater_with_its_pid() -> None:
    found = margins(HEATER, HEATER_PID)
    assert_printed(found, gain="7.28357", phase="84.2356", delay="219.311", Ms="1.16282", Mt="1.0")
    assert found.gain_reduction == 0


def test_heater_at_its_worst_within_half_of_every_parameter() -> None:
    worst = [math.inf, math.inf, math.inf, 0.0]
    for K in (0.5, 0.75, 1, 1.25, 1.5):
        for tau in (0.5, 0.75, 1, 1.25, 1.5):
            for theta in (0.5, 0.75, 1, 1.25, 1.5):
                process = FOPDT(K=2 * K, tau=120 * tau, theta=30 * theta)
                found = margins(process, HEATER_PID)
                worst[:3] = np.minimum(worst[:3], (found.gain, found.phase, found.delay)).tolist()
                worst[3] = max(worst[3], found.Ms)
    assert [f"{x:.{n}f}" for x, n in zip(worst, (3, 1, 1, 3), strict=True)] == [
        "2.065",
        "64.9",
        "86.7",
        "1.970",
    ]


def test_heater_ultimate_gain() -> None:
    assert_printed(margins(HEATER, PID(Kc=1)), gain="3.467")


@pytest.mark.parametrize("theta", [1e-6, 1.0, 3e5])
def test_simc_pi_on_a_lag_with_its_time_cancelled(theta: float) -> None:
    # L = e^(-theta s)/(2 theta s): GM = pi, PM = 90 - 90/pi, exactly.
    found = margins(FOPDT(K=1, tau=5 * theta, theta=theta), PID(Kc=2.5, Ti=5 * theta))
    assert_printed(found, gain="3.142", phase="61.35", Ms="1.590", Mt="1.000")
    assert found.delay / theta == pytest.approx(2.142, abs=5e-4)
    assert found.gain == pytest.approx(math.pi, rel=1e-12)
    assert found.phase == pytest.approx(90 - 90 / math.pi, rel=1e-12)


def test_simc_pi_on_an_integrator() -> None:
    found = margins(IPDT(K=1, theta=1), PID(Kc=0.5, Ti=8))
    assert_printed(found, gain="2.963", phase="46.86", Ms="1.704", Mt="1.299", delay="1.590")


@pytest.mark.parametrize(
    ("alpha", "printed"),
    [
        (0.0, {"gain": "2.761", "phase": "33.11", "Ms": "1.959", "Mt": "1.832"}),
        (0.01, {"gain": "2.536", "Ms": "2.115"}),
        (0.1, {"gain": "1.573", "Ms": "5.32"}),
    ],
)
def test_simc_series_pid_on_a_double_integrator(alpha: float, printed: dict[str, str]) -> None:
    series = SeriesPID(Kc=1 / 16, Ti=8, Td=8, alpha=alpha)
    found = margins(DoubleIntegrator(K=1, theta=1), series.to_isa())
    assert_printed(found, **printed)
    # Conditionally stable: less gain loses it too.
    assert 0 < found.gain_reduction < 1


def test_tyreus_luyben_pi_on_an_integrator() -> None:
    # Ku = pi/2, Pu = 4: Kc = Ku/3.2, Ti = 2.2 Pu.
    found = margins(IPDT(K=1, theta=1), PID(Kc=math.pi / 2 / 3.2, Ti=8.8))
    assert_printed(found, gain="3.04", Ms="1.67")
    assert f"{20 * math.log10(found.Mt):.2f}" == "2.06"


@pytest.mark.parametrize(
    ("controller", "Ms"),
    [
        (PID(Kc=0.35, Ti=13.4), "1.410"),
        (PID(Kc=0.45, Ti=8, Td=0.5, N=math.inf), "1.407"),
        (PID(Kc=0.45, Ti=8, Td=0.5, N=10), "1.446"),
    ],
)
def test_amigo_on_an_integrator(controller: PID, Ms: str) -> None:
    assert_printed(margins(IPDT(K=1, theta=1), controller), Ms=Ms)


@pytest.mark.parametrize(
    ("tau_c", "crossover", "printed"),
    [
        (0.0125, "57.1", {"phase": "73.6", "Ms": "1.290", "Mt": "1.000"}),
        (0.005, "100.0", {"phase": "61.35", "Ms": "1.590"}),
    ],
)
def test_motor(tau_c: float, crossover: str, printed: dict[str, str]) -> None:
    motor = FOPDT(K=100, tau=0.05, theta=0.005)
    controller = PID(Kc=0.05 / (100 * (tau_c + 0.005)), Ti=0.05)
    if tau_c == 0.0125:
        assert f"{controller.Kc:.5f} {controller.Kc / controller.Ti:.4f}" == "0.02857 0.5714"
    assert_printed(margins(motor, controller), **printed)
    assert f"{wc(motor, controller):.1f}" == crossover


@pytest.mark.parametrize(
    ("Kp", "crossover", "phase", "gain_dB"),
    [(0.4, "10.0", "5.8", None), (23.9, "100", "35.0", 12.9)],
)
def test_servo_with_a_notched_resonance(
    Kp: float, crossover: str, phase: str, gain_dB: float | None
) -> None:
    w = 503.0
    resonance, notch_n, notch_d = ((1, 2 * zeta * w, w**2) for zeta in (0.02, 0.05, 0.5))
    process = TransferFunction(
        tuple(250 * w**2 * np.array(notch_n)),
        tuple(np.polymul(np.polymul(resonance, notch_d), (1, 0, 0))),
    )
    controller = PID(Kc=Kp, Td=0.012)
    found = margins(process, controller)
    assert_printed(found, phase=phase)
    digits = len(crossover.partition(".")[2])
    assert f"{wc(process, controller):.{digits}f}" == crossover
    if gain_dB is not None:
        assert 20 * math.log10(found.gain) == pytest.approx(gain_dB, abs=0.05)


@pytest.mark.parametrize(
    ("order", "least", "most"), [(1, 0.27, 0.28), (2, 0.006, 0.008), (3, 0, 1e-3)]
)
def test_a_low_pade_order_overstates_the_gain_margin(order: int, least: float, most: float) -> None:
    process, controller = FOPDT(K=1, tau=4, theta=1), PID(Kc=2, Ti=4)
    approximate = to_control(process, pade_order=order) * controller_to_control(controller)
    exact = margins(process, controller).gain
    assert least < control.stability_margins(approximate)[0] / exact - 1 < most


def random_stable_loop(rng: np.random.Generator) -> tuple[Process, PID, Margins]:
    while True:
        lags = 10 ** rng.uniform(-1, 1, 2)
        theta = 10 ** rng.uniform(-1, 0.5)
        plants: list[Process] = [
            FOPDT(K=2, tau=lags[0], theta=theta),
            SOPDT(K=-0.5, tau1=lags.max(), tau2=lags.min(), theta=theta),
            IPDT(K=0.3, theta=theta),
            TransferFunction((1, -2), (1, 3, 4, 2), theta),
            TransferFunction((1.0,), (1, 0.1, 1), theta),
        ]
        process = plants[rng.integers(5)]
        controller = PID(
            Kc=10 ** rng.uniform(-1, 1),
            Ti=math.inf if rng.random() < 0.1 else 10 ** rng.uniform(-0.5, 1.5),
            Td=0.0 if rng.random() < 0.5 else 10 ** rng.uniform(-1, 0.5),
            tauF=0.0 if rng.random() < 0.7 else 10 ** rng.uniform(-1, 0),
            action=Action.DIRECT if isinstance(process, SOPDT) else Action.REVERSE,
        )
        try:
            return process, controller, margins(process, controller)
        except UnstableLoop:
            continue


def with_gain(controller: PID, factor: float) -> PID:
    c = controller
    return PID(Kc=c.Kc * factor, Ti=c.Ti, Td=c.Td, N=c.N, tauF=c.tauF, action=c.action)


def test_each_margin_is_where_stability_is_lost() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        process, controller, found = random_stable_loop(rng)
        inside, outside = 1 - 1e-7, 1 + 1e-7
        if found.gain < math.inf:
            assert not unstable_poles(process, with_gain(controller, found.gain * inside))
            assert unstable_poles(process, with_gain(controller, found.gain * outside))
        if found.gain_reduction > 0:
            assert not unstable_poles(
                process, with_gain(controller, found.gain_reduction * outside)
            )
            assert unstable_poles(process, with_gain(controller, found.gain_reduction * inside))
        if found.delay < math.inf:
            assert not unstable_poles(process, controller, delay=found.delay * inside)
            assert unstable_poles(process, controller, delay=found.delay * outside)


def test_peaks_bound_the_margins() -> None:
    rng = np.random.default_rng(6)
    for _ in range(60):
        _, _, found = random_stable_loop(rng)
        if found.Ms > 1:
            assert found.gain >= found.Ms / (found.Ms - 1) * (1 - 1e-12)
            assert found.phase >= math.degrees(2 * math.asin(0.5 / found.Ms)) * (1 - 1e-12)
        if found.phase < math.inf:
            assert found.Ms >= 0.5 / math.sin(math.radians(found.phase / 2)) * (1 - 1e-12)


def test_peaks_are_those_of_a_dense_grid() -> None:
    rng = np.random.default_rng(9)
    w = np.geomspace(1e-4, 1e3, 20_001)
    for _ in range(40):
        process, controller, found = random_stable_loop(rng)
        S = np.max(np.abs(sensitivity(process, controller, w)))
        T = np.max(np.abs(complementary_sensitivity(process, controller, w)))
        # A parabola through a summit falls short by a part of the squared step, never more.
        assert S * (1 - 1e-12) <= found.Ms <= S * (1 + 1e-4 * S**2)
        assert T * (1 - 1e-12) <= found.Mt <= T * (1 + 1e-4 * S**2)


@pytest.mark.parametrize("zeta", [1e-2, 1e-4, 1e-6])
def test_a_narrow_resonance_is_not_missed(zeta: float) -> None:
    # At the resonance L = -j k/(2 zeta) turns below -1 by its residual dead-time lag.
    process = TransferFunction((0.1 * zeta,), (1, 2 * zeta, 1), 1.2)
    controller = PID(Kc=10)
    found = margins(process, controller)
    w = 1 + zeta * np.linspace(-30, 30, 400_001)
    S = np.max(np.abs(sensitivity(process, controller, w)))
    assert found.Ms == pytest.approx(S, rel=1e-7)
    assert found.Ms > 1.6


def test_bode_integral() -> None:
    # int ln|S| dw = pi sum Re(unstable open-loop poles); relative degree 2, so the tail is short.
    w = np.geomspace(1e-6, 1e5, 400_001)
    for process, controller, poles in [
        (SOPDT(K=1, tau1=2, tau2=1, theta=0.5), PID(Kc=1, Ti=2), 0.0),
        (TransferFunction((3,), (0.1, 0.9, -1), 0.1), PID(Kc=1, Ti=10), 1.0),
    ]:
        found = margins(process, controller)
        S = np.abs(sensitivity(process, controller, w))
        assert np.max(S) == pytest.approx(found.Ms, rel=1e-6)
        assert np.trapezoid(np.log(S), w) == pytest.approx(math.pi * poles, abs=2e-3)


def test_the_unit_of_time_changes_only_the_delay_margin() -> None:
    for unit in (1e-3, 60.0, 3600.0):
        process = FOPDT(K=2, tau=120 * unit, theta=30 * unit)
        found = margins(process, PID(Kc=0.45, Ti=135 * unit, Td=13.3 * unit))
        here = margins(HEATER, HEATER_PID)
        assert found.delay == pytest.approx(here.delay * unit, rel=1e-12)
        for name in ("gain", "gain_reduction", "phase", "Ms", "Mt"):
            assert getattr(found, name) == pytest.approx(getattr(here, name), rel=1e-12)


@settings(max_examples=15, deadline=None)
@given(span=st.floats(1e-3, 1e3), sign=st.sampled_from([-1, 1]))
def test_the_span_and_direction_of_pv_change_nothing(span: float, sign: int) -> None:
    K = 2 * sign / span
    controller = PID(Kc=0.45 * span, Ti=135, Td=13.3, action=Action.for_gain(K))
    found, here = margins(FOPDT(K=K, tau=120, theta=30), controller), margins(HEATER, HEATER_PID)
    for name in Margins.__dataclass_fields__:
        assert getattr(found, name) == pytest.approx(getattr(here, name), rel=1e-12)


def test_sampling_costs_half_a_scan_of_delay() -> None:
    # h = 0.05/wc costs 1.4 deg, h = 0.314/wc 9 deg.
    continuous = margins(HEATER, HEATER_PID)
    crossover = wc(HEATER, HEATER_PID)
    for part, cost in ((0.05, "1.4"), (0.314, "9.0")):
        sampled = margins(HEATER, HEATER_PID, sample_time=part / crossover)
        assert f"{continuous.phase - sampled.phase:.1f}" == cost
        assert sampled.delay == pytest.approx(continuous.delay - part / crossover / 2, rel=1e-12)
    assert margins(HEATER, HEATER_PID, sample_time=0) == continuous


@pytest.mark.parametrize("sample_time", [-1.0, math.nan, math.inf, 1e300])
def test_an_impossible_sample_time_is_refused_in_words(sample_time: float) -> None:
    with pytest.raises(ValueError, match="sample_time must lie within 0 and 1e\\+09 s"):
        margins(HEATER, HEATER_PID, sample_time=sample_time)


@pytest.mark.parametrize(
    ("process", "controller", "count", "words"),
    [
        (HEATER, PID(Kc=0.45, Ti=135, action=Action.DIRECT), 1, "1 pole in the right half-plane"),
        (HEATER, PID(Kc=10, Ti=135), 2, "2 poles in"),
        (FOPDT(K=1, tau=1, theta=1), PID(Kc=2, Td=1, N=math.inf), INFINITELY_MANY, "infinitely"),
    ],
)
def test_an_unstable_loop_has_no_margins(
    process: Process, controller: PID, count: int, words: str
) -> None:
    with pytest.raises(UnstableLoop, match=words) as caught:
        margins(process, controller)
    assert caught.value.unstable_poles == count


def test_margins_that_do_not_exist_are_infinite() -> None:
    # |L| < 1 everywhere: no gain crossover. Peaks known in closed form at the ends of the axis.
    slow = margins(FOPDT(K=0.5, tau=1, theta=0), PID(Kc=1))
    assert (slow.phase, slow.delay, slow.gain, slow.gain_reduction) == (*[math.inf] * 3, 0)
    assert (slow.Ms, slow.Mt) == pytest.approx((1, 1 / 3))
    # Positive feedback below gain 1: the phase is -180° at w = 0.
    reverse = margins(FOPDT(K=0.5, tau=1, theta=3), PID(Kc=1, action=Action.DIRECT))
    assert (reverse.gain, reverse.Ms, reverse.Mt) == pytest.approx((2, 2, 1))
    # Level gain around dead time comes as close to -1 as its size, for ever.
    level = margins(TransferFunction((0.5,), (1,), 1.0), PID(Kc=1))
    assert (level.gain, level.Ms, level.Mt) == pytest.approx((2, 2, 1))
    assert level.phase == math.inf
    # Without dead time, level gain of the wrong sign ends at -0.5, rising gain at S = 0 and T = 1.
    ends = margins(TransferFunction((-0.5, 1), (1, 1)), PID(Kc=1))
    assert (ends.gain, ends.Ms) == pytest.approx((2, 2))
    rising = margins(TransferFunction((1,), (1,)), PID(Kc=2, Td=1, N=math.inf))
    assert (rising.gain, rising.Ms, rising.Mt) == pytest.approx((math.inf, 1 / 3, 1))
    # A process that blocks constants: S = 1, T = 0 at w = 0.
    blocked = margins(TransferFunction((1, 0), (1, 2, 1), 0.2), PID(Kc=1))
    assert blocked.Ms >= 1
    assert blocked.Mt < 1


def test_all_crossovers_count() -> None:
    # A resonance passes gain 1 three times; the margins are the smallest over all of them.
    process, controller = TransferFunction((1.0,), (1, 0.1, 1, 0), 3.3), PID(Kc=0.15)
    found = margins(process, controller)
    loop = FactoredLoop.of(process, controller)
    crossings = gain_cuts(loop).wc
    assert crossings.size == 3
    turn = np.mod(loop.phase(crossings) + math.pi, 2 * math.pi)
    assert found.delay == pytest.approx(np.min(turn / crossings), rel=1e-12)
    assert found.delay < turn[0] / crossings[0]


def test_two_extremes_closer_than_the_points_of_the_scan_are_both_found() -> None:
    # |L| of (1 + s)^2/(s (1 + s/q)^2) is level at w = sqrt 3 for q = 3, and has a bump beyond.
    for q, turns in ((3 * (1 - 1e-5), 0), (3 * (1 + 1e-5), 2)):
        process = SOPDT(K=0.1, tau1=1 / q, tau2=1 / q, theta=0.1)
        loop = FactoredLoop.of(process, PID(Kc=1, Ti=2, Td=0.5, N=math.inf))
        found = gain_cuts(loop).turns
        assert found.size == turns
        np.testing.assert_allclose(found, math.sqrt(3), rtol=1e-2)


def test_parameters_at_their_limits_give_numbers_without_a_warning() -> None:
    edge = (1e-9, 1.0, 1e9)
    stable = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for Kc in edge:
            for tau in edge:
                for theta in (0.0, 1e-9, 1e9):
                    for Ti in (1e-9, 1e9, math.inf):
                        for Td in (0.0, 1e9):
                            try:
                                found = margins(
                                    FOPDT(K=1, tau=tau, theta=theta), PID(Kc=Kc, Ti=Ti, Td=Td)
                                )
                            except UnstableLoop:
                                continue
                            stable += 1
                            assert found.gain > 1
                            assert 0 <= found.gain_reduction < 1
                            assert found.phase > 0
                            assert found.delay > 0
                            assert 0 < found.Ms < math.inf
                            assert 0 < found.Mt < math.inf
    assert stable > 30
