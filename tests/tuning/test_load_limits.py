import math

import numpy as np
import pytest

from loop.controller import PID
from loop.process import FOPDT, IPDT, TransferFunction
from loop.simulation import simulate
from tuning.load_limits import Disturbance, crossover_window, disturbance_answer, lowest_peak

HEATER = FOPDT(K=2, tau=120, theta=30)
RUNNING = PID(Kc=0.45, Ti=135, Td=13.3)


def test_no_controller_brings_the_heaters_peak_below_the_anchor() -> None:
    found = lowest_peak(HEATER, 10.0, allowed=3.0)

    assert found.peak == pytest.approx(2 * 10 * (1 - math.exp(-0.25)))
    assert found.peak == pytest.approx(4.42, abs=0.005)
    assert found.open_loop == pytest.approx(20.0)
    assert found.possible is False
    assert "The allowed 3 cannot be kept by feedback" in found.sentence
    assert lowest_peak(HEATER, 10.0, allowed=5.0).possible is True
    # Tight or loose, simulated loops stay above it.
    for Kc in (0.45, 1.5, 2.2):
        run = simulate(HEATER, PID(Kc=Kc, Ti=135, Td=13.3), t_end=400, dt=0.5, load=10.0)
        assert np.max(np.abs(run.true_pv)) >= found.peak * (1 - 1e-3)


def test_an_integrator_drifts_and_a_process_without_dead_time_has_no_lower_peak() -> None:
    found = lowest_peak(IPDT(K=0.5, theta=4), -3.0)

    assert found.peak == pytest.approx(6.0)
    assert found.open_loop == math.inf
    assert found.possible is None
    assert lowest_peak(FOPDT(K=2, tau=120, theta=0), 10).peak == 0.0


def test_the_crossover_has_to_fit_between_disturbance_and_unmodelled_dynamics() -> None:
    found = crossover_window(
        HEATER, load=5.0, frequency=0.01, allowed=2.0, unmodelled=20.0, spare_phase=15
    )
    alone = 5 * 2 / math.hypot(1, 1.2)
    assert found.low == pytest.approx(0.01 * math.sqrt((alone / 2) ** 2 - 1))
    assert found.high == pytest.approx(math.tan(math.radians(15)) / 20)
    assert found.possible is False
    assert len(found.sentences) == 3
    # Nothing asked: only the dead time speaks.
    bare = crossover_window(HEATER)
    assert (bare.low, bare.possible) == (0.0, True)
    assert bare.high == pytest.approx(math.pi / 90)
    unstable = crossover_window(TransferFunction((1.0,), (10.0, -1.0)))
    assert unstable.low == pytest.approx(0.1 * math.sqrt(3))
    assert crossover_window(HEATER, load=0.1, frequency=0.01, allowed=2.0).low == 0.0


def test_a_ramp_leaves_what_a_simulated_ramp_leaves() -> None:
    found = disturbance_answer(HEATER, RUNNING, Disturbance.RAMP, 0.01)
    assert found.left == pytest.approx(0.01 * 135 / 0.45)
    assert found.integrators == 2
    load = 0.01 * np.arange(0, 3001) * 2.0
    run = simulate(HEATER, RUNNING, t_end=6000, dt=2.0, load=load)
    # The controller answers PV half a scan late, which a ramp does not see.
    assert abs(run.true_pv[-1]) == pytest.approx(found.left, rel=2e-3)


def test_a_step_leaves_nothing_with_an_integral_and_k_over_one_plus_kkc_without() -> None:
    assert disturbance_answer(HEATER, RUNNING, Disturbance.STEP, 5.0).left == 0.0
    found = disturbance_answer(HEATER, PID(Kc=0.45), Disturbance.STEP, 5.0)
    assert found.left == pytest.approx(5 * 2 / (1 + 0.9))
    assert "PV stays off by 5.263" in found.sentence
    drifting = disturbance_answer(HEATER, PID(Kc=0.45), Disturbance.RAMP, 1.0)
    assert drifting.left == math.inf
    assert "PV runs away" in drifting.sentence
    integrating = disturbance_answer(IPDT(K=0.5, theta=1), PID(Kc=0.4), Disturbance.STEP, 1.0)
    assert integrating.left == pytest.approx(1 / 0.4)
    assert disturbance_answer(HEATER, PID(Kc=0.4), Disturbance.RAMP, 0.0).left == 0.0


def test_a_sinusoid_leaves_what_a_simulated_one_leaves() -> None:
    found = disturbance_answer(HEATER, RUNNING, Disturbance.SINUSOID, 4.0, frequency=0.02)
    t = np.arange(0, 6001) * 1.0
    run = simulate(HEATER, RUNNING, t_end=6000, dt=1.0, load=4.0 * np.sin(0.02 * t))

    assert np.max(np.abs(run.true_pv[4000:])) == pytest.approx(found.left, rel=0.01)
    assert (found.resonator, found.integrators) == (0.02, 0)


def test_impossible_questions_are_refused_in_words() -> None:
    for call, sentence in (
        (lambda: lowest_peak(HEATER, math.nan), "the load must be finite"),
        (lambda: lowest_peak(HEATER, 1.0, allowed=-1), "the allowed deviation must be positive"),
        (lambda: crossover_window(HEATER, frequency=-1.0, allowed=1.0), "must be positive, got -1"),
        (lambda: crossover_window(HEATER, unmodelled=-1.0), "unmodelled must be positive"),
        (
            lambda: disturbance_answer(HEATER, RUNNING, Disturbance.RAMP, math.inf),
            "the size of the disturbance must be finite",
        ),
        (
            lambda: disturbance_answer(HEATER, RUNNING, Disturbance.SINUSOID, 1.0),
            "a sinusoid needs a positive frequency, got None",
        ),
    ):
        with pytest.raises(ValueError, match=sentence):
            call()
