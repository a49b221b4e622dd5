import numpy as np
import pytest

from advice.assess import assess
from loop.controller import PID
from loop.process import FOPDT
from loop.record import Record
from loop.simulation import simulate
from monitoring.basis import Confidence
from monitoring.cause import Action, Cause
from monitoring.oscillation import OscillationComponent
from monitoring.set_point_line import line_sums, set_point_line

N = 2000
T = np.arange(N)


def wave(period: float, amplitude: float, start: float = 0.0) -> OscillationComponent:
    return OscillationComponent(
        period=period, amplitude=amplitude, regularity=9.0, decay_ratio=0.9, score=9.0, share=0.5,
        start=start, end=N - 1.0, cycles=(N - 1 - start) / period, persistent=True,
    )  # fmt: skip


@pytest.mark.parametrize("start", [0.0, 1300.0])
def test_a_sine_in_the_set_point_has_its_amplitude(start: float) -> None:
    sp = 50 + np.where(start <= T, 3 * np.sin(2 * np.pi * T / 80), 0.0)
    found = set_point_line(sp, 1.0, wave(80.0, 2.0, start))
    assert found.ratio == pytest.approx(1.5, rel=0.01)
    assert found.drives


def test_a_set_point_that_swings_too_little_drives_nothing() -> None:
    found = set_point_line(50 + 0.5 * np.sin(2 * np.pi * T / 80), 1.0, wave(80.0, 2.0))
    assert found.score > 1e3
    assert not found.drives


def test_a_set_point_at_rest_drives_nothing() -> None:
    found = set_point_line(np.full(N, 50.1), 1.0, wave(80.0, 2.0))
    assert (found.ratio, found.score, found.drives) == (0.0, 0.0, False)


def test_moves_at_random_drive_no_oscillation() -> None:
    rng = np.random.default_rng(12)
    drives = 0
    for _ in range(400):
        sp = np.full(N, 50.0)
        for at in rng.integers(0, N, rng.integers(1, 25)):
            sp[at:] += rng.normal(0, 3)
        period = float(np.exp(rng.uniform(np.log(8), np.log(300))))
        drives += set_point_line(sp, 1.0, wave(period, rng.uniform(0.05, 3))).drives
    assert drives <= 4


def test_a_set_point_that_steps_to_and_fro_is_what_makes_the_error_swing() -> None:
    sp = np.where((np.arange(1500) // 60) % 2 == 0, 50.0, 55.0)
    run = simulate(
        FOPDT(K=1.0, tau=60.0, theta=10.0), PID(Kc=1.5, Ti=60.0), t_end=7495.0, dt=5.0, sp=sp,
        pv0=50.0, op0=50.0, noise=0.2, rng=np.random.default_rng(1),
    )  # fmt: skip
    found = assess(Record(t=run.t, pv=run.pv, op=run.op, sp=run.sp), kind="temperature")
    assert found.diagnosis.cause is Cause.DISTURBANCE
    assert found.diagnosis.action is Action.LOOK_UPSTREAM
    assert found.diagnosis.confidence is Confidence.HIGH
    assert any("set point swings" in sentence for sentence in found.diagnosis.evidence)


@pytest.mark.parametrize("n", [1, 2, 100, 101, 4999])
def test_the_sums_at_a_few_frequencies_are_those_of_the_definition(n: int) -> None:
    signal = np.random.default_rng(n).normal(size=n)
    cycles = np.array([0.0, 0.3, 7.0, 41.5])
    turns = np.exp(-2j * np.pi * np.outer(cycles, np.arange(n) / n))
    np.testing.assert_allclose(line_sums(signal, cycles), turns @ signal, atol=1e-10)
