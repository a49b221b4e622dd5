"""Models from the waveform of simulated relay tests, against the true process."""

import math

import numpy as np
import pytest

from identification.relay_cycle import limit_cycle
from identification.relay_model import RelayModel, relay_model
from identification.verdict import Verdict
from loop.controller import Action
from loop.errors import NoLimitCycle
from loop.open_loop import process_output
from loop.process import FOPDT, IPDT, SOPDT, Process
from loop.record import Record
from loop.relay_feedback import Relay, simulate_relay


def relay_record(
    process: Process,
    *,
    like: FOPDT,
    bias: float = 0.4,
    noise: float = 0.02,
    cycles: float = 12,
    rest: float = 2.0,
    seed: int = 0,
) -> Record:
    """Relay test of unit amplitude with hysteresis of three times the noise, after a rest.

    Noise is stated as a part of the half swing, rest and length in periods of the process `like`.
    """
    dt = min(like.tau, like.theta) / 20
    swing = limit_cycle(like, amplitude=1.0).amplitude
    sd = noise * swing
    cycle = limit_cycle(like, amplitude=1.0, bias=bias, hysteresis=3 * sd)
    rng = np.random.default_rng(seed)
    run = simulate_relay(
        process,
        Relay(amplitude=1.0, bias=bias, hysteresis=3 * sd, action=Action.for_gain(like.K)),
        t_end=cycles * cycle.period,
        dt=dt,
        noise=sd,
        rng=rng,
    )
    before = round(rest * cycle.period / dt)
    pv = np.concatenate([rng.normal(0, sd, before), run.pv])
    op = np.concatenate([np.zeros(before), run.op])
    return Record(t=dt * np.arange(pv.size), pv=50 + pv, op=30 + op)


def fitted(found: RelayModel) -> FOPDT:
    assert isinstance(found.model.fitted, FOPDT)
    return found.model.fitted


@pytest.mark.parametrize("theta", [0.05, 1.0, 10.0])
def test_errors_are_under_one_percent_without_bias(theta: float) -> None:
    process = FOPDT(K=-2.0, tau=1.0, theta=theta)
    off = []
    for seed in range(4):
        found = relay_model(relay_record(process, like=process, seed=seed))
        assert found.model.verdict is Verdict.TRUSTED
        assert found.model.process == fitted(found)
        assert found.relay.cycles >= 9
        p = fitted(found)
        off.append([p.K / -2 - 1, p.tau - 1, p.theta / theta - 1])
    errors = np.array(off)
    assert np.all(np.median(np.abs(errors), axis=0) < 0.01)
    assert np.all(np.abs(errors.mean(axis=0)) < 4 * errors.std(axis=0, ddof=1) / math.sqrt(4))


def test_standard_errors_are_as_large_as_the_scatter() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    off = []
    for seed in range(6):
        model = relay_model(relay_record(process, like=process, seed=seed)).model
        assert isinstance(model.fitted, FOPDT)
        assert model.standard_errors is not None
        off.append((model.fitted.theta - 1) / model.standard_errors[2])
    # Chi-squared of 6 between its 0.2 % and 99.8 % points.
    assert 0.49 < np.sum(np.square(off)) < 20.8


def test_noise_makes_the_relay_switch_early_which_only_the_half_periods_suffer_from() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=0.3)
    found = relay_model(relay_record(process, like=process))
    assert found.inverted is not None
    assert fitted(found).theta == pytest.approx(0.3, rel=0.005)
    assert found.inverted.tau != pytest.approx(1.0, rel=0.02)
    quiet = relay_model(relay_record(process, like=process, noise=0.0))
    assert quiet.inverted is not None
    assert fitted(quiet).tau == pytest.approx(1.0, rel=1e-6)
    # A scan of theta/20 stretches both half periods by half a scan.
    assert quiet.inverted.theta == pytest.approx(0.3, rel=0.06)


def test_a_symmetric_relay_shows_the_gain_by_the_shape_of_its_wave() -> None:
    process = FOPDT(K=3.0, tau=1.0, theta=1.0)
    found = relay_model(relay_record(process, like=process, bias=0.0))
    assert found.relay.K is None
    assert found.inverted is None
    assert pytest.approx(3.0, rel=0.03) == fitted(found).K
    assert found.model.verdict is Verdict.TRUSTED


def test_a_dead_time_is_not_taken_for_one_that_is_a_whole_period_longer() -> None:
    process = FOPDT(K=0.8, tau=2.6, theta=0.7)
    for seed in range(4):
        found = relay_model(relay_record(process, like=process, rest=0.0, cycles=5.5, seed=seed))
        assert fitted(found).theta == pytest.approx(0.7, abs=0.05)


def test_without_the_rest_before_the_model_says_so_and_still_holds() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=2.0)
    found = relay_model(relay_record(process, like=process, rest=0.0))
    assert found.load is None
    assert any("does not show the rest before" in reason for reason in found.model.reasons)
    assert pytest.approx(1.0, rel=0.02) == fitted(found).K


def test_a_load_that_came_with_the_test_is_found_and_does_not_spoil_the_gain() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    record = relay_record(process, like=process, bias=0.2)
    start = float(record.t[np.argmax(record.op != 30)])
    # It acts like 0.15 of OP from the start of the test on.
    load = process_output(process, record.t, np.where(record.t > start, 0.15, 0.0))
    found = relay_model(Record(t=record.t, pv=record.pv + load, op=record.op))
    assert found.load == pytest.approx(0.15, abs=0.03)
    assert any("load like" in reason for reason in found.model.reasons)
    assert pytest.approx(1.0, rel=0.05) == fitted(found).K
    assert relay_model(record).load == 0


def test_a_drift_during_the_test_is_fitted() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    record = relay_record(process, like=process)
    slope = 0.3 / record.span
    found = relay_model(Record(t=record.t, pv=record.pv + slope * record.t, op=record.op))
    assert found.model.drift == pytest.approx(slope, rel=0.1)
    assert pytest.approx(1.0, rel=0.03) == fitted(found).K


def test_wild_readings_are_left_out() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    record = relay_record(process, like=process)
    pv = record.pv.copy()
    pv[pv.size // 2] += 30
    found = relay_model(Record(t=record.t, pv=pv, op=record.op))
    assert found.model.spikes == 1
    assert fitted(found).tau == pytest.approx(1.0, rel=0.03)


def test_a_process_of_two_lags_is_told_by_its_wave_and_fits_where_the_relay_cycled() -> None:
    process = SOPDT(K=1.0, tau1=1.0, tau2=0.4, theta=0.3)
    found = relay_model(relay_record(process, like=FOPDT(K=1.0, tau=1.2, theta=0.55), cycles=9))
    p = fitted(found)
    w = 2 * math.pi / found.relay.Pu
    true = np.exp(-0.3j * w) / ((1 + 1j * w) * (1 + 0.4j * w))
    model = p.K * np.exp(-1j * w * p.theta) / (1 + 1j * w * p.tau)
    assert abs(model / true - 1) < 0.05
    assert any("the model" in reason.lower() for reason in found.model.reasons)


def test_an_output_that_jitters_is_averaged_over_its_holds() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=0.3)
    record = relay_record(process, like=process, cycles=30)
    jitter = np.random.default_rng(3).normal(0, 0.02, len(record))
    found = relay_model(Record(t=record.t, pv=record.pv, op=record.op + jitter))
    assert fitted(found).tau == pytest.approx(1.0, rel=0.02)


def test_a_square_wave_that_no_relay_made_is_refused() -> None:
    t = np.arange(0.0, 4000.0)
    op = np.where((t // 200) % 2 == 1, 60.0, 50.0)
    pv = process_output(FOPDT(K=2.0, tau=40.0, theta=10.0), t, op, pv0=100.0)
    found = relay_model(Record(t=t, pv=pv, op=op))
    assert found.model.verdict is Verdict.REFUSED
    assert "not switched by a relay" in found.model.reasons[0]


def test_a_gain_beyond_all_processes_is_refused() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    record = relay_record(process, like=process, noise=0.0)
    found = relay_model(Record(t=record.t, pv=(record.pv - 50) * 1e10, op=record.op))
    assert found.model.verdict is Verdict.REFUSED
    assert found.model.process is None
    assert "the fit is no process" in found.model.reasons[0].lower()


def test_two_cycles_are_few_and_unlike_cycles_are_named() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=1.0)
    found = relay_model(relay_record(process, like=process, cycles=3.6))
    assert found.relay.cycles == 2
    assert found.model.verdict is Verdict.CARE
    assert any("fewer than 3" in reason for reason in found.model.reasons)
    record = relay_record(process, like=process, noise=0.0)
    cycle = np.cumsum(np.diff(record.op, prepend=record.op[0]) > 0)
    size = 1 + 0.085 * (np.arange(40) % 3 - 1)
    found = relay_model(Record(t=record.t, pv=50 + (record.pv - 50) * size[cycle], op=record.op))
    assert found.model.verdict is not Verdict.TRUSTED
    assert "% in swing" in " ".join(found.model.reasons[:2])


def test_too_few_samples_are_refused() -> None:
    op = np.array([0.0, 0.0, 1.0, 1.0] * 3)
    pv = np.roll(op, 1)
    with pytest.raises(NoLimitCycle, match="samples lie in the settled cycles"):
        relay_model(Record(t=np.arange(12.0), pv=pv, op=op))


@pytest.mark.parametrize(("time", "span", "output"), [(60.0, 0.1, 5.0), (1 / 3600, -30.0, 0.2)])
def test_units_change_only_what_they_measure(time: float, span: float, output: float) -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=0.7)
    record = relay_record(process, like=process, cycles=6)
    one = fitted(relay_model(record))
    other = fitted(
        relay_model(Record(t=record.t * time, pv=record.pv * span - 7, op=record.op * output + 3))
    )
    np.testing.assert_allclose(
        [other.K, other.tau, other.theta],
        [one.K * span / output, one.tau * time, one.theta * time],
        rtol=1e-5,
    )


def test_an_integrating_process_is_found_as_one() -> None:
    process = IPDT(K=-0.05, theta=4.0)
    like = FOPDT(K=-50.0, tau=1000.0, theta=4.0)
    found = relay_model(relay_record(process, like=like, bias=0.3, cycles=8, noise=0.03))
    assert found.model.kind == "IPDT"
    assert found.model.verdict is Verdict.CARE
    assert found.ultimate is None
    model = found.model.process
    assert isinstance(model, IPDT)
    assert pytest.approx(-0.05, rel=0.03) == model.K
    assert model.theta == pytest.approx(4.0, rel=0.05)
    assert "taken for an integrator" in found.model.reasons[0]
    assert found.model.standard_errors is not None
    assert abs(model.K + 0.05) < 4 * found.model.standard_errors[0]


def test_cycles_that_tell_neither_the_gain_nor_its_slope_are_refused() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=0.3)
    record = relay_record(process, like=process, bias=0.0, cycles=3.6, rest=0.0)
    noise = np.random.default_rng(1).normal(0, 0.5, len(record))
    found = relay_model(Record(t=record.t, pv=record.pv + noise, op=record.op))
    assert found.model.verdict is Verdict.REFUSED
    assert found.model.process is None
