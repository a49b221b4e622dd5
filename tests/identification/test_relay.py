"""Relay tests, simulated exactly, against the closed forms of the limit cycle."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from identification.relay import RelayResult, looks_like_relay, relay_test
from loop.errors import NoLimitCycle
from loop.record import Record


def relay_record(
    *,
    theta: float,
    tau: float = 1.0,
    K: float = 1.0,
    d: float = 1.0,
    bias: float = 0.0,
    eps: float = 0.0,
    cycles: int = 8,
    per_dead_time: int = 100,
    noise: float = 0.0,
    rest: int = 0,
    seed: int = 0,
) -> Record:
    """Simulate a relay on first order plus dead time, one exact step of the lag a sample.

    The relay sees PV without the noise: the reading is tested here and not the relay.
    """
    h = theta / per_dead_time
    a = math.exp(-h / tau)
    x, level = 0.0, 1.0
    waiting = [0.0] * per_dead_time
    pv, op = [0.0] * rest, [0.0] * rest
    falls = 0
    while falls <= cycles:
        sign = math.copysign(1.0, K)
        if level > 0 and sign * x > eps:
            level, falls = -1.0, falls + 1
        elif level < 0 and sign * x < -eps:
            level = 1.0
        u = bias + d * level
        pv.append(x)
        op.append(u)
        waiting.append(u)
        x = a * x + (1 - a) * K * waiting.pop(0)
    noisy = np.array(pv) + np.random.default_rng(seed).normal(0, noise, len(pv))
    return Record(t=h * np.arange(len(pv)), pv=50 + noisy, op=30 + np.array(op))


def exact_ultimate(theta: float, tau: float = 1.0) -> tuple[float, float]:
    """Ultimate gain of unit gain and period from the phase of first order plus dead time."""
    w = brentq(lambda w: w * theta + math.atan(w * tau) - math.pi, 1e-6, math.pi / theta)
    return math.hypot(1, w * tau), 2 * math.pi / w


@pytest.mark.parametrize("theta", [0.05, 0.3, 1.0, 3.0, 10.0])
def test_amplitude_and_period_are_those_of_the_closed_form(theta: float) -> None:
    found = relay_test(relay_record(theta=theta))
    E = math.exp(theta)
    assert found.amplitude == pytest.approx(1 - 1 / E, rel=0.02)
    assert found.Pu == pytest.approx(2 * math.log(2 * E - 1), rel=0.02)
    assert found.relay_amplitude == 1
    assert found.gain_sign == 1
    assert found.K is None


@pytest.mark.parametrize(("theta", "error"), [(0.05, -0.19), (10.0, 0.22)])
def test_the_error_of_the_describing_function_is_the_stated_one(theta: float, error: float) -> None:
    found = relay_test(relay_record(theta=theta, per_dead_time=400))
    Ku, _ = exact_ultimate(theta)
    assert found.Ku / Ku - 1 == pytest.approx(error, abs=0.015)


@pytest.mark.parametrize("theta", [0.08, 0.2, 1.0, 5.0])
def test_the_true_ultimate_gain_lies_in_the_stated_range(theta: float) -> None:
    found = relay_test(relay_record(theta=theta))
    assert found.Ku_low < exact_ultimate(theta)[0] < found.Ku_high


def test_the_half_and_not_the_whole_relay_amplitude_counts() -> None:
    found = relay_test(relay_record(theta=1.0, d=4.0))
    assert found.relay_amplitude == 4
    assert found.Ku == pytest.approx(4 / (math.pi * (1 - math.exp(-1))), rel=0.02)


@pytest.mark.parametrize(("bias", "eps"), [(0.3, 0.0), (0.3, 0.1), (-0.2, 0.05), (0.0, 0.1)])
def test_a_biased_relay_with_hysteresis_agrees_with_its_closed_form(
    bias: float, eps: float
) -> None:
    K, tau, theta, d = 2.0, 1.5, 0.6, 1.0
    record = relay_record(
        theta=theta, tau=tau, K=K, d=d, bias=bias, eps=eps, rest=50, per_dead_time=300
    )
    found = relay_test(record, hysteresis=eps)
    E = math.exp(theta / tau)
    highest = (bias + d) * K * (1 - 1 / E) + eps / E
    lowest = (bias - d) * K * (1 - 1 / E) - eps / E
    high = tau * math.log((2 * d * K * E + bias * K - d * K + eps) / (d * K + bias * K - eps))
    low = tau * math.log((2 * d * K * E - d * K - bias * K + eps) / (d * K - bias * K - eps))
    assert found.amplitude == pytest.approx((highest - lowest) / 2, rel=0.02)
    assert found.Pu == pytest.approx(high + low, rel=0.01)
    assert found.Ku == pytest.approx(
        4 * d / (math.pi * math.sqrt(((highest - lowest) / 2) ** 2 - eps**2)), rel=0.03
    )
    if bias:
        np.testing.assert_allclose(found.K, K, rtol=0.02)
    else:
        assert found.K is None
        assert "hardly biased" in found.remarks[-1]


def test_without_the_rest_before_the_test_there_is_no_static_gain() -> None:
    found = relay_test(relay_record(theta=0.6, bias=0.3))
    assert found.K is None
    assert "does not show the rest" in found.remarks[-1]


def test_a_process_that_goes_against_its_output_is_told() -> None:
    found = relay_test(relay_record(theta=0.6, K=-2.0))
    assert found.gain_sign == -1
    assert found.Ku > 0


@pytest.mark.parametrize("theta", [0.3, 3.0])
def test_noise_does_not_make_the_amplitude(theta: float) -> None:
    clean = relay_test(relay_record(theta=theta))
    record = relay_record(theta=theta, noise=0.08 * clean.amplitude)
    noisy = relay_test(record)
    by_extremes = np.ptp(record.pv) / 2
    assert by_extremes > 1.1 * clean.amplitude
    assert noisy.amplitude == pytest.approx(clean.amplitude, rel=0.06)
    assert noisy.noise_sd == pytest.approx(0.08 * clean.amplitude, rel=0.2)
    assert noisy.amplitude_spread < 0.1


def test_one_wild_reading_changes_little() -> None:
    record = relay_record(theta=1.0)
    pv = record.pv.copy()
    pv[pv.size // 2] += 20 * np.ptp(pv)
    wild = relay_test(Record(t=record.t, pv=pv, op=record.op))
    assert wild.amplitude == pytest.approx(relay_test(record).amplitude, rel=0.1)


def test_transient_cycles_are_left_out() -> None:
    record = relay_record(theta=0.3, cycles=10)
    growing = record.pv - 50
    growing[: growing.size // 3] *= 1.8
    found = relay_test(Record(t=record.t, pv=50 + growing, op=record.op))
    assert found.discarded >= 2
    assert found.amplitude == pytest.approx(1 - math.exp(-0.3), rel=0.03)


def test_gaps_in_the_signals_do_not_matter() -> None:
    record = relay_record(theta=1.0)
    pv = record.pv.copy()
    pv[::7] = np.nan
    holes = relay_test(Record(t=record.t, pv=pv, op=record.op))
    assert holes.Ku == pytest.approx(relay_test(record).Ku, rel=0.02)


@pytest.mark.parametrize(("speed", "span", "output"), [(60, 0.1, 5), (1 / 3600, -30, 0.2)])
def test_units_change_only_what_they_measure(speed: float, span: float, output: float) -> None:
    record = relay_record(theta=0.5, bias=0.3, rest=50, noise=0.01)
    one = relay_test(record)
    other = relay_test(
        Record(t=record.t * speed, pv=record.pv * span - 7, op=record.op * output + 3)
    )
    assert other.Pu == pytest.approx(one.Pu * speed)
    assert other.Ku == pytest.approx(one.Ku * output / abs(span))
    assert one.K is not None
    np.testing.assert_allclose(other.K, one.K * span / output)


def cut(record: Record, samples: int) -> Record:
    return Record(t=record.t[:samples], pv=record.pv[:samples], op=record.op[:samples])


def chattering(at: int = -4) -> Record:
    record = relay_record(theta=1.0)
    op = record.op.copy()
    switches = np.flatnonzero(np.diff(op))
    op[switches[at] + 3] = op[switches[at]]
    return Record(t=record.t, pv=record.pv, op=op)


T = np.arange(400.0)
SQUARE = np.where(np.sin(2 * np.pi * T / 40) > 0, 60.0, 40.0)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        pytest.param(Record(t=T, pv=np.sin(T), op=np.full(400, 50.0)), "stands still", id="still"),
        pytest.param(Record(t=T, pv=np.ones(400), op=SQUARE), "stands still", id="no answer"),
        pytest.param(Record(t=T[:3], pv=T[:3], op=T[:3]), "too few", id="too few"),
        pytest.param(Record(t=T, pv=T, op=50 + 10 * np.sin(T / 9)), "no relay's", id="sine"),
        pytest.param(cut(relay_record(theta=1.0), 500), "goes up", id="too short"),
        pytest.param(chattering(), "chatters", id="chatter"),
        pytest.param(
            Record(t=T, pv=np.exp(T / 60) * np.sin(2 * np.pi * T / 40), op=SQUARE),
            "have not settled",
            id="growing",
        ),
    ],
)
def test_what_is_no_settled_relay_test_is_refused(record: Record, words: str) -> None:
    with pytest.raises(NoLimitCycle, match=words):
        relay_test(record)
    assert not looks_like_relay(record)


def test_chatter_at_the_start_belongs_to_the_transient_cycles() -> None:
    found = relay_test(chattering(at=2))
    usual = relay_test(relay_record(theta=1.0))
    assert found.cycles < usual.cycles
    assert pytest.approx(usual.Pu, rel=1e-3) == found.Pu


def test_a_hysteresis_wider_than_the_swing_is_refused() -> None:
    with pytest.raises(NoLimitCycle, match="less than the hysteresis"):
        relay_test(relay_record(theta=1.0), hysteresis=5.0)


def test_a_relay_test_looks_like_one_and_a_step_test_does_not() -> None:
    assert looks_like_relay(relay_record(theta=1.0))
    step = np.where(T > 100, 50.0, 40.0)
    assert not looks_like_relay(Record(t=T, pv=1 - np.exp(-T / 50), op=step))


def test_the_remarks_say_what_was_used_and_how_far_off_it_can_be() -> None:
    found: RelayResult = relay_test(relay_record(theta=1.0))
    assert f"{found.cycles} settled cycles are used" in found.remarks[0]
    assert "off by -19 % to +23 %" in found.remarks[1]


@pytest.mark.parametrize("theta", [0.1, 0.25, 2.0])
def test_a_hysteresis_widens_the_range_of_the_true_ultimate_gain(theta: float) -> None:
    eps = 0.2 * (1 - math.exp(-theta))
    found = relay_test(relay_record(theta=theta, eps=eps), hysteresis=eps)
    Ku, _ = exact_ultimate(theta)
    assert found.Ku_low < Ku < found.Ku_high
    plain = relay_test(relay_record(theta=theta))
    assert found.Ku < plain.Ku  # it cycles more slowly
