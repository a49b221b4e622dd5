"""Figures of the pages on what a record does and does not say: errors, structures, honesty."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from docs.figures.style import (
    ACCENT,
    INK,
    Draw,
    band,
    data,
    held,
    label,
    mark,
    model,
    panels,
    truth,
)
from identification.draws import parameter_draws
from identification.held_input import HeldInput, lag_response
from identification.identify import Identification, identify
from identification.planner import Wishes, plan_steps, planned_errors
from identification.repeats import pool
from identification.steps import find_moves
from identification.theta_interval import profile_interval
from identification.two_point import smith_two_point
from loop.open_loop import process_output
from loop.process import FOPDT, SOPDT
from loop.record import Record
from loop.signals import Real

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def _bump(t: Real, noise: float, seed: int, process: FOPDT | SOPDT = HEATER) -> Record:
    op = np.where(t < 100, 40.0, 45.0)
    pv = process_output(process, t, op, pv0=70.0)
    return Record(t=t, pv=pv + np.random.default_rng(seed).normal(0, noise, t.size), op=op)


def smith() -> Figure:
    """Smith's two points on an answer of one lag."""
    t = np.arange(0.0, 700.0, 2.0)
    record = _bump(t, 0.0, 0)
    after = t >= 100
    found = smith_two_point(
        t[after], record.pv[after], step_at=100.0, op_change=5.0, pv_from=70.0, pv_to=80.0
    )
    figure, (axes,) = panels()
    truth(axes, t, record.pv, "PV")
    for instant, part in ((found.t28, 0.2835), (found.t63, 0.6321)):
        axes.plot([100 + instant], [70 + 10 * part], "o", color=ACCENT)
        mark(axes, x=100 + instant)
        axes.annotate(
            f" {100 * part:.1f} %, {instant:.0f} s after the step",
            (100 + instant, 70 + 10 * part - 0.5),
        )
    p = found.process
    title = f"tau = 1.5 (t63 - t28) = {p.tau:.0f} s, theta = t63 - tau = {p.theta:.0f} s"
    label(axes, x="Time [s]", y="PV [°C]", title=title)
    return figure


def moves() -> Figure:
    """A jittering output with a step and a ramp, and the moves found in it."""
    t = np.arange(0.0, 800.0, 2.0)
    clean = np.interp(t, [0, 150, 151, 400, 480, 800], [40, 40, 45, 45, 41, 41])
    op = clean + np.random.default_rng(0).normal(0, 0.15, t.size)
    figure, (axes,) = panels()
    data(axes, t, op, "OP with jitter")
    for i, step in enumerate(find_moves(t, op).steps):
        levels = np.array([step.op_from, step.op_from, step.op_to, step.op_to])
        around = np.array([step.start - 60, step.start, step.end, step.end + 60])
        model(axes, around, levels, "" if i else "moves found, from hold to hold")
    label(axes, x="Time [s]", y="OP [%]", title="Steps and ramps are one move each")
    return figure


def structures() -> Figure:
    """What one lag leaves of an answer with two."""
    t = np.arange(0.0, 900.0, 2.0)
    record = _bump(t, 0.05, 1, SOPDT(K=2.0, tau1=80.0, tau2=60.0, theta=10.0))
    found = identify(record)
    assert found.choice is not None
    figure, (top, bottom) = panels(2, heights=(1.5, 1.0))
    data(top, t, record.pv, "PV")
    model(top, t, found.choice.chosen.fit.predict(t), found.choice.chosen.structure.name)
    label(top, y="PV [°C]", title=found.choice.reason.split(":")[0], legend="lower right")
    for candidate in found.choice.candidates:
        if candidate.structure.name in ("first order", found.choice.chosen.structure.name):
            left = record.pv - candidate.fit.predict(t)
            (data if candidate is found.choice.chosen else truth)(
                bottom, t, left, f"left by {candidate.structure.name}"
            )
    label(bottom, x="Time [s]", y="PV − model [°C]")
    return figure


def _refused_lag() -> Identification:
    t = np.arange(0.0, 400.0, 4.0)
    op = np.where(t < 100, 40.0, 50.0)
    pv = 20 + 20 * np.where(t > 100, 1 - np.exp(-(t - 100) / 50), 0)
    return identify(Record(t=t, pv=pv + np.random.default_rng(0).normal(0, 1, t.size), op=op))


def dead_time() -> Figure:
    """The sum of squares over theta against the parabola of the standard error."""
    found = _refused_lag()
    assert found.t is not None
    assert found.pv is not None
    assert found.standard_errors is not None
    assert isinstance(found.fitted, FOPDT)
    low, high = profile_interval(found)
    held_input = HeldInput(instants=np.array([100.0]), levels=np.array([40.0, 50.0]))
    thetas = np.linspace(0.0, 16.0, 60)
    squares = []
    for theta in thetas.tolist():
        least = np.inf
        for tau in np.linspace(30.0, 80.0, 60).tolist():
            x = lag_response(held_input, found.t, tau, theta)[0]
            design = np.stack((x, np.ones_like(x)), axis=1)
            left = found.pv - design @ np.linalg.lstsq(design, found.pv, rcond=None)[0]
            least = min(least, float(left @ left))
        squares.append(least)
    ratio = np.array(squares) / min(squares)
    parabola = 1 + ((thetas - found.fitted.theta) / found.standard_errors[2]) ** 2 / (
        found.t.size - 4
    )
    figure, (axes,) = panels()
    band(
        axes,
        np.array([low, high]),
        np.full(2, 0.99),
        np.full(2, float(ratio.max())),
        "95 % by profile",
    )
    model(axes, thetas, ratio, "least sum of squares at each theta")
    truth(axes, thetas, np.minimum(parabola, ratio.max()), "parabola of the standard error")
    label(
        axes,
        x="theta [s]",
        y="SSE over its least [-]",
        title="No dead time: the interval ends at 0",
    )
    return figure


def draws() -> Figure:
    """K and tau of a test that ended early move together."""
    t = np.arange(0.0, 160.0)
    op = np.where(t < 60, 40.0, 45.0)
    pv = 20 + 10 * np.where(t > 80, 1 - np.exp(-(t - 80) / 50), 0)
    noisy = pv + np.random.default_rng(1).normal(0, 0.1, t.size)
    K, tau, _ = parameter_draws(identify(Record(t=t, pv=noisy, op=op)), n=400).T
    figure, (axes,) = panels()
    order = np.argsort(K)
    data(axes, K[order], tau[order], "draws")
    axes.plot([2.0], [50.0], "o", color=ACCENT, label="true process", zorder=5)
    title = "A test that ended early: K/tau is what is known"
    label(axes, x="K [°C/%]", y="tau [s]", title=title, legend="upper left")
    return figure


def planned() -> Figure:
    """Planned moves, and how the planned errors fall with the number of moves."""
    plan = plan_steps(Wishes(guess=HEATER, noise=1.2, deviation=9.0))
    t = np.linspace(0.0, plan.duration, 600)
    at = np.searchsorted(plan.times, t, side="right")
    op = np.append(0.0, plan.levels)[at]
    figure, (top, bottom) = panels(2)
    pv = process_output(HEATER, t, op)
    data(top, t, pv + np.random.default_rng(0).normal(0, 1.2, t.size), "PV expected, with noise")
    for sign in (1.0, -1.0):
        mark(top, y=sign * plan.abort_deviation, name="" if sign < 0 else "stop here")
    label(top, y="PV from rest [°C]", title=f"{len(plan.times)} planned moves of {plan.step:.1f} %")
    held(bottom, t, op)
    label(bottom, x="Time [s]", y="OP from rest [%]")
    return figure


def repeats() -> Figure:
    """Six tests with their intervals, the pooled one, and the one that does not belong."""
    t = np.arange(0.0, 700.0, 4.0)
    gains = (2.0, 2.03, 1.97, 2.01, 3.6, 1.99)
    found = [
        identify(_bump(t, 0.3, seed, FOPDT(K=gain, tau=120.0, theta=30.0)))
        for seed, gain in enumerate(gains)
    ]
    pooled = pool(found)
    figure, (axes,) = panels()
    width = 1.96 * float(pooled.standard_errors[0])
    ends = np.array([0.5, len(found) + 0.5])
    K = pooled.process.K
    band(axes, ends, np.full(2, K - width), np.full(2, K + width), "pooled, 95 %")
    out = {test.index for test in pooled.left_out}
    for i, one in enumerate(found):
        assert one.intervals is not None
        low, high = one.intervals[0].tolist()
        color = ACCENT if i in out else INK
        axes.plot([i + 1, i + 1], [low, high], "-", color=color, linewidth=2)
        axes.plot([i + 1], [(low + high) / 2], "o", color=color)
    title = "Test 5 is left out: its gain stands as Fahrenheit to Celsius"
    label(axes, x="Test [-]", y="K [°C/%]", title=title)
    return figure


def honesty() -> Figure:
    """What a historian's lines between few readings do to noise."""
    t = np.arange(0.0, 601.0)
    op = np.where(t < 100, 40.0, 50.0)
    process = FOPDT(K=2.0, tau=60.0, theta=12.0)
    pv = process_output(process, t, op, pv0=20.0) + np.random.default_rng(0).normal(0, 0.4, t.size)
    kept = np.interp(t, t[::10], pv[::10])
    figure, (top, bottom) = panels(2, share_x=True)
    part = (t > 90) & (t < 300)
    data(top, t[part], pv[part], "as read")
    label(
        top,
        y="PV [°C]",
        title=f"Every reading: {identify(Record(t=t, pv=pv, op=op)).verdict.value}",
    )
    data(bottom, t[part], kept[part], "one in ten kept, lines between")
    verdict = identify(Record(t=t, pv=kept, op=op)).verdict.value
    label(bottom, x="Time [s]", y="PV [°C]", title=f"Drawn by a historian: {verdict}")
    return figure


def verdicts() -> Figure:
    """How the expected error of K and tau grows as a test ends earlier, with the limits of care."""
    lengths = np.linspace(0.6, 4.0, 40)
    half = []
    for n in lengths.tolist():
        duration = 100 + 30 + 120 * n
        held_input = HeldInput(instants=np.array([100.0]), levels=np.array([40.0, 45.0]))
        found = planned_errors(HEATER, held_input, duration=duration, sample_time=2.0, noise=0.2)
        half.append(100 * 1.96 * found[:2] / np.array([HEATER.K, HEATER.tau]))
    errors = np.array(half)
    figure, (axes,) = panels()
    model(axes, lengths, errors[:, 0], "K")
    truth(axes, lengths, errors[:, 1], "tau")
    mark(axes, y=20.0, name="use with care above 20 %, refused above 50 %")
    mark(axes, y=50.0)
    axes.set_yscale("log")
    title = "Half-width of the 95 % interval by length of hold, noise 2 % of the answer"
    label(axes, x="Time after the dead time, over tau [-]", y="Half-width [%]", title=title)
    return figure


FIGURES: Mapping[str, Draw] = {
    "data-honesty": honesty,
    "dead-time-interval": dead_time,
    "model-verdict": verdicts,
    "parameter-draws": draws,
    "process-structures": structures,
    "repeated-tests": repeats,
    "smith-two-point": smith,
    "steps": moves,
    "test-planner": planned,
}
