"""Figures of the pages on relay tests and on routine data: loops whose truth is known."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from docs.figures.style import ACCENT, INK, Draw, data, held, label, mark, model, panels, truth
from identification.closed_loop import identify_routine
from identification.relay_cycle import limit_cycle
from identification.relay_model import relay_model
from identification.relay_ultimate import ultimate_gain_and_period
from identification.running_controller import running_controller
from loop.controller import PID
from loop.experiment import Step
from loop.process import FOPDT
from loop.record import Record
from loop.relay_feedback import Relay, simulate_relay
from loop.simulation import simulate

PROCESS = FOPDT(K=2.0, tau=20.0, theta=6.0)


def relay_waveform() -> Figure:
    """A biased relay test in noise, and the extremes of the fitted model's cycle."""
    rng = np.random.default_rng(1)
    relay = Relay(amplitude=2.0, bias=0.6, hysteresis=0.2)
    run = simulate_relay(
        PROCESS, relay, t_end=420.0, dt=0.5, noise=0.06, rng=rng, pv0=50.0, op0=40.0
    )
    # The rest before the test shows the bias, and with it the static gain.
    before = np.arange(0.0, 60.0, 0.5)
    t = np.concatenate((before, run.t + 60.0))
    pv = np.concatenate((50 + rng.normal(0.0, 0.06, before.size), run.pv))
    op = np.concatenate((np.full(before.size, 40.0), run.op))
    found = relay_model(Record(t=t, pv=pv, op=op), hysteresis=0.2).model
    assert isinstance(found.process, FOPDT)
    p = found.process
    cycle = limit_cycle(p, amplitude=2.0, bias=0.6, hysteresis=0.2)
    figure, (top, bottom) = panels(2, heights=(1.7, 1.0))
    data(top, t, pv, "PV")
    mark(top, y=50 + cycle.highest, name="extremes of the fitted model's cycle")
    mark(top, y=50 + cycle.lowest)
    title = f"Fitted K {p.K:.3f}, tau {p.tau:.2f} s, theta {p.theta:.2f} s (true 2, 20 s, 6 s)"
    label(top, y="PV [°C]", title=title, legend="lower right")
    held(bottom, t, op)
    label(bottom, x="Time [s]", y="OP [%]")
    return figure


def describing_function() -> Figure:
    """Ku by describing function over the true one, against the ratio of dead time to lag."""
    ratios = np.geomspace(0.05, 10.0, 60)
    errors, periods = [], []
    for ratio in ratios.tolist():
        cycle = limit_cycle(FOPDT(K=1.0, tau=1.0, theta=ratio), amplitude=1.0)
        Ku, Pu = ultimate_gain_and_period(1.0, 1.0, ratio)
        amplitude = (cycle.highest - cycle.lowest) / 2
        errors.append(100 * (4 / (np.pi * amplitude) / Ku - 1))
        periods.append(100 * (cycle.period / Pu - 1))
    figure, (axes,) = panels()
    model(axes, ratios, np.array(errors), "Ku = 4 d/(π a)")
    truth(axes, ratios, np.array(periods), "period of the cycle as Pu")
    mark(axes, y=0.0)
    axes.set_xscale("log")
    title = "Error of the describing function on one lag with dead time"
    label(axes, x="theta/tau [-]", y="Error [%]", title=title)
    return figure


def routine_data() -> Figure:
    """Set-point moves in automatic, and the model's answer to the OP that ran."""
    t = np.arange(1500.0)
    sp = np.where(t // 300 % 2 == 1, 51.0, 50.0)
    process = FOPDT(K=1.0, tau=50.0, theta=15.0)
    run = simulate(
        process, PID(Kc=1.2, Ti=50.0), t_end=1499.5, dt=1.0, sp=sp, pv0=50.0, noise=0.03,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    found = identify_routine(Record(t=run.t, sp=run.sp, pv=run.pv, op=run.op))
    assert isinstance(found.process, FOPDT)
    p = found.process
    figure, (top, bottom) = panels(2, heights=(1.7, 1.0))
    data(top, run.t, run.pv, "PV")
    held(top, run.t[::4], run.sp[::4], "SP")
    title = f"Routine data: theta {p.theta:.1f} s, tau {p.tau:.0f} s, K {p.K:.2f} (true 15, 50, 1)"
    label(top, y="PV, SP [°C]", title=title, legend="lower right")
    held(bottom, run.t[::4], run.op[::4])
    label(bottom, x="Time [s]", y="OP [%]")
    return figure


def running_settings() -> Figure:
    """What the controller did, and what the settings read from it would have done."""
    run = simulate(
        FOPDT(K=2.0, tau=60.0, theta=10.0), PID(Kc=1.2, Ti=70.0, b=0.0), t_end=600.0, dt=1.0,
        sp=Step(size=5.0, at=100.0), noise=0.1, rng=np.random.default_rng(1),
    )  # fmt: skip
    found = running_controller(Record(t=run.t, sp=run.sp, pv=run.pv, op=run.op))
    assert found.pid is not None
    pid, error = found.pid, run.sp - run.pv
    said = pid.Kc * (pid.b * run.sp - run.pv) + pid.Kc / pid.Ti * np.cumsum(error)
    figure, (top, bottom) = panels(2, heights=(1.0, 1.2))
    data(top, run.t, run.pv, "PV")
    held(top, run.t, run.sp, "SP")
    label(top, y="PV, SP [°C]", legend="lower right")
    bottom.step(run.t, run.op, where="post", color=INK, linewidth=1.2, label="OP recorded")
    bottom.plot(
        run.t, said + np.mean(run.op - said), "--", color=ACCENT, linewidth=1.4,
        label=f"Kc {pid.Kc:.2f}, Ti {pid.Ti:.0f} s, b {pid.b:g}, as read",
    )  # fmt: skip
    label(bottom, x="Time [s]", y="OP [%]", legend="lower right")
    return figure


FIGURES: Mapping[str, Draw] = {
    "closed-loop-identification": routine_data,
    "relay-describing-function": describing_function,
    "relay-model": relay_waveform,
    "running-controller": running_settings,
}
