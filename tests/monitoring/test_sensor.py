import numpy as np
import pytest

from loop.controller import PID
from loop.experiment import Step
from loop.measures import step_measures
from loop.process import FOPDT
from loop.signals import Real
from loop.simulation import simulate
from monitoring.loop_signals import LoopSignals, Stretch
from monitoring.sensor import SensorHealth, noise_level, resolution_of, sensor_health
from monitoring.set_point_moves import set_point_moves

RNG = np.random.default_rng(4)
N = 4000


def health(pv: Real, op: Real | None = None) -> SensorHealth:
    return sensor_health(
        LoopSignals(dt=2.0, pv=pv, op=np.sin(np.arange(pv.size)) if op is None else op)
    )


def test_the_noise_level_of_white_noise_on_a_slow_wave_is_its_sd() -> None:
    slow = 20 * np.sin(np.arange(N) / 200)
    found = noise_level(slow + RNG.normal(0, 0.5, N))
    assert found == pytest.approx(0.5, rel=0.08)  # three standard errors at 4,000 samples


def test_the_resolution_is_the_step_that_rounded_the_signal() -> None:
    pv = np.round(RNG.normal(0, 1, N) / 0.25) * 0.25 + 0.1
    assert resolution_of(pv) == pytest.approx(0.25)
    assert resolution_of(RNG.normal(0, 1, N)) is None
    assert resolution_of(np.ones(50)) is None
    uneven = np.array([0.0, 1.0, 2.5])[RNG.integers(0, 3, N)]
    assert resolution_of(uneven) is None
    coarse = health(np.where(np.arange(N) < 60, 1.0, 0.0))
    assert coarse.coarse


def test_a_frozen_sensor_is_one_that_stands_while_the_output_moves() -> None:
    pv = RNG.normal(0, 1, N)
    pv[1000:1600] = pv[1000]
    found = health(pv)
    assert found.frozen
    assert found.longest_flat == pytest.approx(599 * 2.0)
    assert not health(pv, op=np.ones(N)).frozen
    assert not health(pv, op=np.full(N, np.nan)).frozen


def test_a_clipped_signal_is_told_by_its_rests_at_the_top() -> None:
    wave = np.sin(np.arange(N) / 20)
    found = health(np.minimum(wave, 0.8))
    assert found.clipped == pytest.approx(np.mean(wave >= 0.8))
    assert health(wave + RNG.normal(0, 0.01, N)).clipped == 0
    assert health(np.ones(N)).clipped == 0


def test_the_compression_factor_is_samples_a_pivot() -> None:
    pivots = RNG.normal(0, 1, N // 8 + 1)
    pv = np.interp(np.arange(N), np.arange(pivots.size) * 8, pivots)
    found = health(pv)
    assert found.compression == pytest.approx(8, rel=0.02)
    assert found.compressed
    clean = health(RNG.normal(0, 1, N))
    assert clean.compression == 1
    assert not clean.compressed


def test_too_few_values_are_refused_with_the_good_share() -> None:
    found = health(np.r_[np.ones(20), np.full(80, np.nan)])
    assert found.basis.refused
    assert found.good == pytest.approx(0.2)
    assert found.noise is None


def simulated(
    sp_moves: list[tuple[int, float]], *, Kc: float = 2.0, noise: float = 0.0, n: int = 1200
) -> Stretch:
    sp = np.zeros(n)
    for at, level in sp_moves:
        sp[at:] = level
    run = simulate(
        FOPDT(K=1, tau=20, theta=5), PID(Kc=Kc, Ti=20), t_end=n - 1.0, dt=1.0, sp=sp,
        noise=noise, rng=np.random.default_rng(1),
    )  # fmt: skip
    return Stretch(first=0, dt=1.0, pv=run.pv, op=run.op, sp=run.sp, share=1.0)


def test_a_set_point_response_is_what_the_simulated_step_measures() -> None:
    stretch = simulated([(300, 4.0), (800, 1.0)])
    found = set_point_moves(stretch)
    assert found.count == 2
    assert [r.at for r in found.responses] == [300.0, 800.0]
    step = simulate(
        FOPDT(K=1, tau=20, theta=5), PID(Kc=2.0, Ti=20), t_end=400.0, dt=1.0,
        sp=Step(at=0.0, size=-3.0),
    )  # fmt: skip
    truth = step_measures(step.t, step.pv, step.op, sp=-3.0, pv0=0.0, band=0.05)
    second = found.responses[1]
    assert second.size == pytest.approx(-3)
    assert second.overshoot == pytest.approx(truth.overshoot, abs=0.01)
    assert second.rise_time == pytest.approx(truth.rise_time, abs=0.01)
    assert second.settling_time == pytest.approx(truth.settling_time, abs=0.1)


def test_the_decay_ratio_of_a_lively_loop_lies_between_its_peaks() -> None:
    lively = set_point_moves(simulated([(300, 4.0)], Kc=4.5))
    run = lively.responses[0]
    assert run.decay_ratio is not None
    assert 0.1 < run.decay_ratio < 0.9
    assert run.overshoot > 30
    calm = set_point_moves(simulated([(300, 4.0)], Kc=1.5)).responses[0]
    assert calm.decay_ratio is None


def test_moves_within_the_noise_or_too_soon_after_another_are_left_out() -> None:
    found = set_point_moves(simulated([(300, 0.05), (600, 4.0), (610, 8.0)], noise=0.1))
    assert found.count == 2
    assert [r.size for r in found.responses] == pytest.approx([4.0])


def test_a_set_point_that_always_moves_is_followed_not_stepped() -> None:
    stretch = simulated([])
    ramp = Stretch(first=0, dt=1.0, pv=stretch.pv, op=stretch.op, sp=np.arange(1200.0), share=1.0)
    found = set_point_moves(ramp)
    assert found.following
    assert found.responses == ()
    silent = Stretch(first=0, dt=1.0, pv=stretch.pv, op=stretch.op, sp=None, share=1.0)
    assert set_point_moves(silent).basis.refused
    assert set_point_moves(stretch).count == 0


def test_noise_is_neither_overshoot_nor_a_loop_that_does_not_settle() -> None:
    n = 1500
    sp = np.where((np.arange(n) // 150) % 2 == 0, 50.0, 55.0)

    def followed(noise: float) -> Stretch:
        run = simulate(
            FOPDT(K=1.0, tau=60.0, theta=10.0), PID(Kc=1.5, Ti=60.0), t_end=(n - 1) * 5.0, dt=5.0,
            sp=sp, pv0=50.0, op0=50.0, noise=noise, rng=np.random.default_rng(3),
        )  # fmt: skip
        return Stretch(first=0, dt=5.0, pv=run.pv, op=run.op, sp=run.sp, share=1.0)

    clean = set_point_moves(followed(0.0)).responses[0]
    assert clean.overshoot == 0
    assert clean.settling_time is not None
    found = set_point_moves(followed(0.2)).responses
    assert len(found) == 9
    for response in found:
        assert response.overshoot == 0
        assert response.settling_time is not None
        assert response.settling_time < 1.2 * clean.settling_time
