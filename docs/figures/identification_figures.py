"""Figures of the pages on identification: simulated tests whose truth is known.

Run `python -m docs.figures` in the root of the project to draw them all again.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from docs.figures.style import ACCENT, Draw, band, data, held, label, model, panels, truth
from identification.frequency_response import frequency_response as measured
from identification.identify import identify
from loop.open_loop import process_output
from loop.process import FOPDT
from loop.record import Record
from loop.valve import DeadBand, stem_positions


def fopdt_least_squares() -> Figure:
    """A staircase in noise with a drift: readings, model and what the model leaves."""
    t = np.arange(0.0, 2400.0, 4.0)
    op = np.select([t < 200, t < 900, t < 1600], [40.0, 45.0, 38.0], 40.0)
    pv = process_output(FOPDT(K=2.0, tau=120.0, theta=30.0), t, op, pv0=70.0)
    pv += 0.002 * t + np.random.default_rng(3).normal(0.0, 0.4, t.size)
    found = identify(Record(t=t, pv=pv, op=op))
    assert found.predicted is not None
    assert found.residual is not None
    assert found.noise_sd is not None
    figure, (top, middle, bottom) = panels(3, heights=(3.0, 1.0, 1.4))
    data(top, t, pv, "PV")
    model(top, t, found.predicted, "model with its drift")
    label(top, y="PV [°C]", title="A step test with drift")
    held(middle, t, op)
    label(middle, y="OP [%]")
    noise = np.full(2, 2 * found.noise_sd)
    band(bottom, t[[0, -1]], -noise, noise, "± 2 sd of noise")
    data(bottom, t, found.residual)
    label(bottom, x="Time [s]", y="PV − model [°C]", legend="upper right")
    return figure


def dead_band() -> Figure:
    """A staircase on a valve with play: output, stem and answer."""
    t = np.arange(0.0, 1500.0, 2.5)
    op = np.array([40.0, 43, 46, 49, 46, 43, 40])[(t * 7 // 1500).astype(int)]
    stem = stem_positions(DeadBand(width=1.0), op)
    pv = process_output(FOPDT(K=2.0, tau=40.0, theta=12.0), t, stem, pv0=50.0)
    pv += np.random.default_rng(0).normal(0.0, 0.2, t.size)
    found = identify(Record(t=t, pv=pv, op=op))
    assert found.predicted is not None
    assert found.dead_band is not None
    band_found = found.dead_band
    stairs = band_found.stem
    figure, (top, bottom) = panels(2, heights=(1.6, 1.0))
    data(top, t, pv, "PV")
    model(top, t, found.predicted, "model behind the valve")
    label(top, y="PV [°C]", title=f"Dead band {band_found.width:.2f} % of OP (true 1.00 %)")
    held(bottom, t, op, "OP")
    times = np.concatenate(([0.0], stairs.instants, t[-1:]))
    levels = np.append(stairs.levels, stairs.levels[-1])
    bottom.step(times, levels, where="post", color=ACCENT, linestyle="--", label="valve, fitted")
    label(bottom, x="Time [s]", y="OP [%]")
    return figure


def frequency_response() -> Figure:
    """A multisine: measured points with their band, and the true response."""
    t = 0.5 * np.arange(3000)
    lines = np.arange(1, 31)
    waves = [np.sin(2 * np.pi / 750 * k * t - np.pi * k * (k - 1) / 30) for k in lines.tolist()]
    op = 40 + 5 * np.sum(waves, axis=0) / np.max(np.abs(np.sum(waves, axis=0)))
    process = FOPDT(K=2.0, tau=20.0, theta=5.0)
    pv = process_output(process, t, op, pv0=80.0)
    pv += np.random.default_rng(0).normal(0.0, 1.0, t.size)
    found = measured(Record(t=t, pv=pv, op=op))
    size, phase = np.abs(found.G), np.degrees(np.unwrap(np.angle(found.G)))
    part = 1.96 * found.sd / size / 2**0.5
    w = np.geomspace(found.w[0], found.w[-1], 200)
    figure, (top, bottom) = panels(2)
    band(top, found.w, size * np.exp(-part), size * np.exp(part), "95 % band")
    data(top, found.w, size, "measured")
    truth(top, w, process.K / np.abs(1j * w * process.tau + 1), "true process")
    top.set(xscale="log", yscale="log")
    label(top, y="|G| [°C/%]", title="Response measured by a multisine", legend="lower left")
    turn = np.degrees(part)
    band(bottom, found.w, phase - turn, phase + turn)
    data(bottom, found.w, phase)
    truth(bottom, w, -np.degrees(np.arctan(w * process.tau) + w * process.theta))
    bottom.set_xscale("log")
    label(bottom, x="Frequency [rad/s]", y="Phase [°]")
    return figure


FIGURES: Mapping[str, Draw] = {
    "dead-band": dead_band,
    "fopdt-least-squares": fopdt_least_squares,
    "frequency-response": frequency_response,
}
