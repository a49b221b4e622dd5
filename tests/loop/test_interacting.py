"""Loops that disturb each other, against the sum of open-loop answers to what was recorded."""

from dataclasses import replace

import numpy as np
import pytest

from loop.controller import PID, Action
from loop.digital_pid import OutputLimits
from loop.errors import LoopDiverged
from loop.experiment import Experiment, Step
from loop.interacting import simulate_cascade, simulate_interacting
from loop.open_loop import process_output
from loop.process import FOPDT, TransferFunction
from loop.sensor_faults import Biased
from loop.simulation import simulate
from loop.valve import Choudhury

# Wood and Berry's distillation column, minutes taken as seconds; the numbers are from memory and
# serve as an interacting plant only.
COLUMN = (
    (FOPDT(K=12.8, tau=16.7, theta=1), FOPDT(K=-18.9, tau=21, theta=3)),
    (FOPDT(K=6.6, tau=10.9, theta=7), FOPDT(K=-19.4, tau=14.4, theta=3)),
)
CONTROLLERS = (PID(Kc=0.2, Ti=12), PID(Kc=0.06, Ti=20, action=Action.DIRECT))
REST = Experiment(t_end=300, dt=0.5)


def test_each_pv_is_the_sum_of_what_the_outputs_do_to_it() -> None:
    experiments = (
        replace(REST, sp=Step(size=1.0, at=10), valve=Choudhury(S=0.05, J=0.02), pv0=96, op0=50),
        replace(REST, load=Step(size=0.02, at=120), pv0=3, op0=40),
    )
    runs = simulate_interacting(COLUMN, CONTROLLERS, experiments)
    t = runs[0].t
    inputs = (runs[0].position - 50, runs[1].position - 40 + np.where(t >= 120, 0.02, 0.0))
    for i, rest in enumerate((96, 3)):
        parts = [process_output(COLUMN[i][j], t, inputs[j], op_before=0.0) for j in (0, 1)]
        np.testing.assert_allclose(runs[i].true_pv, rest + sum(parts), atol=1e-9)
    assert np.ptp(runs[0].position - runs[0].op) > 0.02


def test_all_loops_reach_their_set_points_together() -> None:
    """At rest the outputs solve K op = sp."""
    experiments = (replace(REST, t_end=2000, sp=0.75), replace(REST, t_end=2000, sp=-0.4))
    runs = simulate_interacting(COLUMN, CONTROLLERS, experiments)
    assert [run.pv[-1] for run in runs] == pytest.approx([0.75, -0.4], abs=1e-6)
    op = np.linalg.solve([[12.8, -18.9], [6.6, -19.4]], [0.75, -0.4])
    assert [run.op[-1] for run in runs] == pytest.approx(op, abs=1e-6)


def test_loops_without_influence_run_as_alone() -> None:
    lonely = ((COLUMN[0][0], None), (None, COLUMN[1][1]))
    experiments = (
        replace(REST, sp=Step(size=1.0, at=5), limits=OutputLimits(low=-0.1, high=0.15)),
        replace(REST, load=0.03, faults=[Biased(size=0.1, start=50)], pv_filter=2.0),
    )
    runs = simulate_interacting(lonely, CONTROLLERS, experiments)
    alone = (
        simulate(
            COLUMN[0][0],
            CONTROLLERS[0],
            t_end=300,
            dt=0.5,
            sp=Step(size=1.0, at=5),
            limits=OutputLimits(low=-0.1, high=0.15),
        ),
        simulate(
            COLUMN[1][1],
            CONTROLLERS[1],
            t_end=300,
            dt=0.5,
            load=0.03,
            faults=[Biased(size=0.1, start=50)],
            pv_filter=2.0,
        ),
    )
    for run, other in zip(runs, alone, strict=True):
        np.testing.assert_array_equal(run.pv, other.pv)
        np.testing.assert_array_equal(run.op, other.op)
        np.testing.assert_array_equal(run.sp, other.sp)


def test_a_sticking_valve_upstream_swings_the_loop_downstream_at_its_period() -> None:
    flow, level = FOPDT(K=1, tau=6, theta=2), FOPDT(K=2, tau=40, theta=5)
    downstream = ((flow, None), (FOPDT(K=0.5, tau=40, theta=8), level))
    rest = Experiment(t_end=4000, dt=1)
    runs = simulate_interacting(
        downstream,
        (PID(Kc=0.8, Ti=5), PID(Kc=0.6, Ti=40)),
        (replace(rest, sp=1.0, valve=Choudhury(S=3, J=1.5)), rest),
    )
    spectra = [np.abs(np.fft.rfft(run.pv[1000:] - run.pv[1000:].mean())) for run in runs]
    assert np.argmax(spectra[0]) == np.argmax(spectra[1]) > 5
    np.testing.assert_array_equal(runs[1].op, runs[1].position)


def test_a_cascade_is_its_two_processes_in_series() -> None:
    flow, temperature = FOPDT(K=0.8, tau=5, theta=1.3), FOPDT(K=1.5, tau=90, theta=20)
    outer = Experiment(t_end=900, dt=1, sp=Step(size=3, at=20), pv0=150, op0=40, load=-0.4)
    inner = Experiment(
        t_end=900, dt=1, load=Step(size=2, at=400), pv0=40, op0=55, valve=Choudhury(S=0.3, J=0.1)
    )
    run = simulate_cascade(
        temperature, flow, PID(Kc=1.4, Ti=95), PID(Kc=1.5, Ti=5), outer=outer, inner=inner
    )
    t, stem = run.inner.t, run.inner.position - 55 + np.where(run.inner.t >= 400, 2.0, 0.0)
    np.testing.assert_array_equal(run.inner.sp, run.outer.op)
    np.testing.assert_allclose(
        run.inner.true_pv, 40 + process_output(flow, t, stem, op_before=0.0), atol=1e-9
    )
    both = TransferFunction((0.8 * 1.5,), tuple(np.polymul((5, 1), (90, 1))), 21.3)
    through = process_output(both, t, stem, op_before=0.0)
    pushed = process_output(temperature, t, np.full(t.size, -0.4), op_before=0.0)
    np.testing.assert_allclose(run.outer.true_pv, 150 + through + pushed, atol=1e-9)
    assert abs(run.outer.pv[-1] - 153) < 0.2


def test_a_cascade_keeps_an_inner_load_from_the_outer_loop() -> None:
    flow, temperature = FOPDT(K=0.8, tau=5, theta=1), FOPDT(K=1.5, tau=90, theta=20)
    both = TransferFunction((0.8 * 1.5,), tuple(np.polymul((5, 1), (90, 1))), 21)
    rest = Experiment(t_end=900, dt=1)
    cascade = simulate_cascade(
        temperature,
        flow,
        PID(Kc=1.4, Ti=95),
        PID(Kc=1.5, Ti=5),
        outer=rest,
        inner=replace(rest, load=5.0),
    )
    single = simulate(both, PID(Kc=1.4 / 0.8, Ti=95), t_end=900, dt=1, load=5.0)
    assert cascade.outer.pv[-1] == pytest.approx(0, abs=1e-3)
    assert np.max(np.abs(cascade.outer.pv)) < 0.2 * np.max(np.abs(single.pv))


def test_plants_that_do_not_fit_together_are_refused() -> None:
    with pytest.raises(ValueError, match="2 controllers need 2 experiments and 2 rows of 2"):
        simulate_interacting(COLUMN[:1], CONTROLLERS, [REST, REST])
    with pytest.raises(ValueError, match="0 controllers"):
        simulate_interacting([], [], [])
    with pytest.raises(ValueError, match="the same scan time and length"):
        simulate_interacting(COLUMN, CONTROLLERS, [REST, replace(REST, dt=1)])
    pid, process = PID(Kc=1, Ti=9), FOPDT(K=1, tau=9, theta=2)
    for outer, inner in (
        (replace(REST, op0=3), REST),
        (REST, replace(REST, sp=1.0)),
        (replace(REST, valve=Choudhury(S=1, J=0)), REST),
    ):
        with pytest.raises(ValueError, match="op0 of the outer"):
            simulate_cascade(process, process, pid, pid, outer=outer, inner=inner)


def test_interacting_loops_that_grow_say_so() -> None:
    wrong = (CONTROLLERS[0], PID(Kc=5, Ti=1, action=Action.REVERSE))
    with pytest.raises(LoopDiverged):
        simulate_interacting(COLUMN, wrong, [replace(REST, sp=1.0), REST])
