"""Figures of the pages on tuning, verification and simulation, about one heater."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from docs.figures.style import Draw, held, label, mark, model, panels, truth
from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits
from loop.margins import margins
from loop.process import FOPDT
from loop.response import loop_response
from loop.simulation import simulate
from loop.valve import Choudhury, DeadBand, Valve, stem_positions
from tuning.box_proof import prove_box
from tuning.catalogue import RULES
from tuning.detuning import front
from tuning.profiles import PROFILES
from tuning.verification import verify

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)
DASHES = ("-", "--", ":")
INK = "#1b2a41"


def simc() -> Figure:
    """Answers to a set point and a load at three speeds."""
    figure, (top, bottom) = panels(2, heights=(1.0, 1.0))
    rule = RULES["simc"].structures["PI"]
    for times, dash in zip((1.0, 1.44, 3.0), DASHES, strict=True):
        pid = rule(HEATER, tau_c=times * HEATER.theta)
        peak = margins(HEATER, pid).Ms
        run = simulate(HEATER, pid, t_end=900, dt=1.0, sp=1.0)
        load = simulate(HEATER, pid, t_end=900, dt=1.0, load=1.0)
        name = f"tau_c = {times:g} theta, Ms {peak:.2f}"
        top.plot(run.t, run.pv, dash, color=INK, linewidth=1.4, label=name)
        bottom.plot(load.t, load.pv, dash, color=INK, linewidth=1.4)
    label(top, y="PV [°C]", title="Set-point step of 1 °C", legend="lower right")
    label(bottom, x="Time [s]", y="PV [°C]", title="Load step of 1 % at the process input")
    return figure


def verification() -> Figure:
    """Ms over the error of each parameter, for two speeds of one rule."""
    figure, (left, right) = panels(2, columns=2)
    rule = RULES["simc"].structures["PI"]
    for axes, times in ((left, 1.0), (right, 1.44)):
        found = verify(HEATER, rule(HEATER, tau_c=times * HEATER.theta), PROFILES["general"])
        error = 100 * (found.factors - 1)
        for name, peaks, dash in zip(found.parameters, found.sweep.Ms, DASHES, strict=True):
            axes.plot(error, peaks, dash, color=INK, linewidth=1.4, label=f"error of {name}")
        mark(axes, y=PROFILES["general"].Ms)
        axes.set_ylim(1.0, 2.7)
        verdict = "passes" if found.passes else "fails"
        label(
            axes, x="Error of the model [%]", y="Ms [-]", legend="upper right",
            title=f"SIMC PI at tau_c = {times:g} theta {verdict}",
        )  # fmt: skip
    return figure


def detuning() -> Figure:
    """The front of load area against Ms, for PI and PID."""
    figure, (axes,) = panels()
    for structure, draw in (("PI", truth), ("PID", model)):
        points = front(HEATER, structure=structure, points=9).points  # type: ignore[arg-type]
        peaks = np.array([point.margins.Ms for point in points])
        areas = np.array([point.load_IAE for point in points])
        draw(axes, peaks, areas, f"optimal {structure}")
    axes.set_xlim(1.15, 2.1)
    for peak, name in ((1.2, "calm"), (1.6, "normal"), (2.0, "fast")):
        mark(axes, x=peak)
        axes.annotate(name, (peak, axes.get_ylim()[1]), xytext=(3, -9), textcoords="offset points")
    label(axes, x="Ms [-]", y="IAE after a load step of 1 % [°C s]", title="What calmness costs")
    return figure


def simulation() -> Figure:
    """A set-point step into the limit of the output, with and without a cure for wind-up."""
    figure, (top, bottom) = panels(2, heights=(1.4, 1.0))
    draws = {
        AntiWindup.NONE: (truth, "none"),
        AntiWindup.BACK_CALCULATION: (model, "back calculation"),
        AntiWindup.CLAMPING: (held, "clamping"),
    }
    for mode, (draw, name) in draws.items():
        run = simulate(
            HEATER, PID(Kc=1.5, Ti=135.0), t_end=2500, dt=1.0, sp=1.2,
            limits=OutputLimits(low=0.0, high=0.63), anti_windup=mode,
        )  # fmt: skip
        some = slice(None, None, 6)
        draw(top, run.t[some], run.pv[some], f"anti-windup: {name}")
        draw(bottom, run.t[some], run.op[some])
    mark(top, y=1.2)
    mark(bottom, y=0.63)
    label(top, y="PV [°C]", title="The output runs into its limit", legend="lower right")
    label(bottom, x="Time [s]", y="OP [%]")
    return figure


def margin_circle() -> Figure:
    """Nyquist plot with exact dead time, and with the Padé approximation of order one."""
    pid = PID(Kc=1.2, Ti=120.0)
    w = np.geomspace(2e-3, 0.6, 600)
    exact = loop_response(HEATER, pid, w)
    s = 1j * w * HEATER.theta
    pade = exact * np.exp(s) * (1 - s / 2) / (1 + s / 2)
    peak = margins(HEATER, pid).Ms
    figure, (axes,) = panels()
    model(axes, exact.real, exact.imag, "exact dead time")
    truth(axes, pade.real, pade.imag, "Padé of order 1")
    angle = np.linspace(0, 2 * np.pi, 200)
    circle = -1 + np.exp(1j * angle) / peak
    axes.plot(circle.real, circle.imag, ":", color=INK, label=f"circle of Ms = {peak:.2f}")
    axes.plot([-1], [0], "o", color=INK, markersize=4)
    axes.set_xlim(-2.0, 1.0)
    axes.set_ylim(-1.4, 0.7)
    axes.set_aspect("equal")
    label(axes, x="Re L [-]", y="Im L [-]", title="L touches the circle of its Ms; Padé stays off")
    return figure


def box_proof() -> Figure:
    """Proven worst Ms over boxes of growing size, beside the corners."""
    pid = RULES["lambda_pi"].structures["PI"](HEATER)
    sizes = np.arange(0.05, 0.91, 0.05)
    proven, nominal = [], margins(HEATER, pid).Ms
    for size in sizes:
        proof = prove_box(HEATER, pid, errors=dict.fromkeys(("K", "tau", "theta"), float(size)))
        proven.append(proof.worst["Ms"].bound)
    figure, (axes,) = panels()
    model(axes, 100 * sizes, np.array(proven), "no plant of the box is above")
    mark(axes, y=PROFILES["general"].Ms, name="limit of the general profile")
    mark(axes, y=nominal, name="Ms of the model")
    axes.set_ylim(1.0, 4.0)
    label(
        axes, x="Errors of K, tau and theta at once, ± [%]", y="Worst Ms [-]",
        title="Lambda PI on the heater", legend="upper left",
    )  # fmt: skip
    return figure


def valve_models() -> Figure:
    """Stem over output for a dead band and two sticking valves."""
    op = 50 + 10 * np.sin(np.linspace(0, 4 * np.pi, 800))
    valves: tuple[tuple[Valve, str], ...] = (
        (DeadBand(width=6.0), "dead band of 6 %"),
        (Choudhury(S=6.0, J=2.0), "S 6 %, J 2 %"),
        (Choudhury(S=6.0, J=6.0), "S 6 %, J 6 %"),
    )
    figure, drawn = panels(3, columns=3)
    for axes, (valve, name) in zip(drawn, valves, strict=True):
        stem = stem_positions(valve, op)
        truth(axes, op[::8], op[::8])
        model(axes, op[400:], stem[400:])
        label(axes, x="OP [%]", y="Stem [%]" if axes is drawn[0] else "", title=name)
    return figure


FIGURES: Mapping[str, Draw] = {
    "simc": simc,
    "verification": verification,
    "detuning": detuning,
    "simulation": simulation,
    "margins": margin_circle,
    "box-proof": box_proof,
    "valve-models": valve_models,
}
