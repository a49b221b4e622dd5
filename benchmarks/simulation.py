"""Closed-loop simulation with output limits and anti-windup, in steps a second."""

import math
from collections.abc import Callable

import control
import numpy as np
import simple_pid

from benchmarks.section import Section, Target
from benchmarks.timing import Timing, interleaved
from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits
from loop.process import FOPDT
from loop.signals import Real
from loop.simulation import simulate
from loop.simulation_batch import simulate_batch

PROCESS = FOPDT(K=2.0, tau=120.0, theta=30.0)
CONTROLLER = PID(Kc=0.9, Ti=120.0)
HIGHEST = 15.0
SET_POINT = 20.0
SCAN = 1.0
STEPS = 5_000
LOOPS = 1_000
BATCH_STEPS = 1_000

DECAY = math.exp(-SCAN / PROCESS.tau)
PUSH = PROCESS.K * (1 - DECAY)
DELAY = round(PROCESS.theta / SCAN)


def with_simple_pid() -> Real:
    """Run the loop with simple-pid; the exactly sampled process is a line of Python."""
    pid = simple_pid.PID(
        CONTROLLER.Kc,
        CONTROLLER.Kc / CONTROLLER.Ti,
        0.0,
        setpoint=SET_POINT,
        sample_time=None,
        output_limits=(0.0, HIGHEST),
    )
    waiting = [0.0] * DELAY
    pv = [0.0] * STEPS
    x, place = 0.0, 0
    for k in range(STEPS):
        pv[k] = x
        op = pid(x, dt=SCAN)
        arriving, waiting[place] = waiting[place], op
        place = (place + 1) % DELAY
        x = DECAY * x + PUSH * arriving
    return np.array(pv)


def _next_state(t: float, x: Real, u: Real, params: dict[str, float]) -> Real:  # noqa: ARG001
    """Move process, integral and dead time by one scan: pv, I, u(k-1) ... u(k-d), from sp."""
    wanted, op = _outputs(x, u)
    following = np.empty_like(x)
    following[0] = DECAY * x[0] + PUSH * x[-1]
    following[1] = x[1] + SCAN / CONTROLLER.Ti * (CONTROLLER.Kc * (u[0] - x[0]) + op - wanted)
    following[2] = op
    following[3:] = x[2:-1]
    return following


def _outputs(x: Real, u: Real) -> tuple[float, float]:
    wanted = CONTROLLER.Kc * (u[0] - x[0]) + x[1]
    return wanted, min(max(wanted, 0.0), HIGHEST)


def _pv_and_op(t: float, x: Real, u: Real, params: dict[str, float]) -> list[float]:  # noqa: ARG001
    return [x[0], _outputs(x, u)[1]]


def with_control() -> Real:
    """Run the loop with python-control: one discrete non-linear system, back-calculation in it."""
    system = control.nlsys(_next_state, _pv_and_op, states=2 + DELAY, inputs=1, outputs=2, dt=SCAN)
    t = np.arange(STEPS) * SCAN
    answer = control.input_output_response(
        system, t, np.full(STEPS, SET_POINT), np.zeros(2 + DELAY)
    )
    return np.asarray(answer.outputs[0])


def _ours(anti_windup: AntiWindup) -> Real:
    return simulate(
        PROCESS,
        CONTROLLER,
        t_end=(STEPS - 1) * SCAN,
        dt=SCAN,
        sp=SET_POINT,
        limits=OutputLimits(low=0.0, high=HIGHEST),
        anti_windup=anti_windup,
    ).true_pv


def with_loopwright() -> Real:
    """Run the loop once."""
    return _ours(AntiWindup.BACK_CALCULATION)


def with_a_batch() -> Real:
    """Run a thousand loops at once, the gains of their controllers spread by +-20 %."""
    spread = np.linspace(0.8, 1.2, LOOPS)
    spread[0] = 1.0
    return simulate_batch(
        [PROCESS],
        [PID(Kc=CONTROLLER.Kc * factor, Ti=CONTROLLER.Ti) for factor in spread],
        t_end=(BATCH_STEPS - 1) * SCAN,
        dt=SCAN,
        sp=SET_POINT,
        limits=OutputLimits(low=0.0, high=HIGHEST),
    ).true_pv


def _difference(pv: Real, reference: Real) -> str:
    n = min(pv.size, reference.size)
    return f"{np.max(np.abs(pv[:n] - reference[:n])) / SET_POINT:.1e}"


def run() -> Section:
    """Simulate a set-point step into the output's limit, all ways in turn."""
    works: dict[str, tuple[Callable[[], Real], int, str]] = {
        "Loopwright, batch of 1,000 loops": (with_a_batch, LOOPS * BATCH_STEPS, "same law"),
        "Loopwright, one loop": (with_loopwright, STEPS, "back-calculation"),
        "simple-pid": (with_simple_pid, STEPS, "integral clamped to the limits"),
        "python-control": (with_control, STEPS, "back-calculation, written by us"),
    }
    timings = interleaved({name: work for name, (work, _, _) in works.items()}, repeats=15)
    reference = with_loopwright()
    rows, speeds = [], {}
    for name, (work, steps, windup) in works.items():
        pv = work()
        pv = pv[:, 0] if pv.ndim == 2 else pv
        speeds[name] = steps / timings[name].median
        rows.append((name, _speed(steps, timings[name]), windup, _difference(pv, reference)))
    batch = speeds["Loopwright, batch of 1,000 loops"]
    return Section(
        title="Closed-loop simulation with limits and anti-windup",
        how=(
            f"PI on K={PROCESS.K:g}, tau={PROCESS.tau:g} s, theta={PROCESS.theta:g} s, scan "
            f"{SCAN:g} s, set-point step of {SET_POINT:g} that drives the output into its limit "
            f"of {HIGHEST:g}. One step is one scan of one loop, process included."
        ),
        columns=("by", "million steps/s", "anti-windup", "largest difference in PV, share of step"),
        rows=tuple(rows),
        targets=(
            Target(
                what="batch",
                limit=10.0,
                reached=batch / 1e6,
                unit="million steps/s",
                at_least=True,
            ),
            Target(
                what="batch against python-control",
                limit=100.0,
                reached=batch / speeds["python-control"],
                unit="times",
                at_least=True,
            ),
        ),
        notes=(
            "Differences in PV are differences of the law, not of accuracy: Loopwright integrates "
            "along the line between two measurements, python-control's system and simple-pid by "
            "rectangles, and simple-pid clamps its integral where the others back-calculate.",
            "simple-pid has no process, filter or rate limit; the process is a line of Python "
            "beside it.",
        ),
    )


def _speed(steps: int, timing: Timing) -> str:
    return f"{steps / timing.median / 1e6:.3g} ({steps / timing.best / 1e6:.3g})"
