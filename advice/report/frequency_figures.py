"""The measured response of a frequency test in a report: points, band, model, margins."""

import numpy as np

from advice.display import digits
from advice.facts import op_unit, pv_unit
from advice.frequency import FrequencyCase
from advice.report.drawing import MARK, QUIET, STRONG, Axis, Figure, Look, line, points, stacked
from advice.report.section import Section, section
from advice.tune import TuningCase
from loop.process import Process, rational_response
from loop.signals import Real

CONFIDENT = 1.96
EDGE = Look(QUIET, "solid", 0.6)
FILL = "rgba(138, 148, 160, 0.28)"


def frequency_sections(case: TuningCase) -> list[Section]:
    """Draw the measured response of a frequency test; nothing for any other record.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    """
    found = case.frequency
    if found is None:
        return []
    model = None if case.model is None or case.model.structure is None else case.model.structure
    process = None if model is None else model.process
    unit = f"{pv_unit(case.record)}/{op_unit(case.record)}"
    caption = " ".join(
        (
            f"Measured response, {found.response.w.size} points with their 95 % band, and the "
            "model's.",
            *margin_words(found),
        )
    )
    figure = measured_response(found, process, unit)
    return [section("Measured frequency response", {"measured": (figure, caption)})]


def measured_response(found: FrequencyCase, process: Process | None, unit: str) -> Figure:
    """Draw size and phase of the measured points with their 95 % band, and the model's.

    Parameters
    ----------
    found : FrequencyCase
        The measured response.
    process : Process or None
        Model; nothing is drawn for none.
    unit : str
        Of the gain.
    """
    measured = found.response
    w, size = measured.w, np.abs(measured.G)
    phase = np.degrees(np.unwrap(np.angle(measured.G)))
    part = CONFIDENT * measured.sd / size / 2**0.5
    turn = np.degrees(part)
    traces = [
        *_band(w, size * np.exp(-part), size * np.exp(part), panel=1),
        points(w, size, "measured", panel=1),
        *_band(w, phase - turn, phase + turn, panel=2),
        points(w, phase, "", panel=2),
    ]
    if process is not None:
        grid = np.geomspace(float(w[0]), float(w[-1]), 300)
        rational = rational_response(process, 1j * grid)
        said = np.degrees(np.unwrap(np.angle(rational)) - grid * process.theta)
        # Both start within the same turn.
        said -= 360 * np.round((said[0] - phase[0]) / 360)
        traces += [
            line(grid, np.abs(rational), "model", STRONG, panel=1),
            line(grid, said, "model", STRONG, panel=2, legend=False),
        ]
    if found.margins is not None and found.margins.w180 is not None:
        at = np.full(2, found.margins.w180)
        ends = np.array([float(np.min(size)), float(np.max(size))])
        traces.append(line(at, ends, "phase crossover of the loop", MARK, panel=1))
    return stacked(
        traces,
        Axis(title="w [rad/s]", log=True),
        [Axis(title=f"|G| [{unit}]", log=True), Axis(title="arg G [°]")],
        height=460,
    )


def _band(w: Real, low: Real, high: Real, *, panel: int) -> list[Figure]:
    below = line(w, low, "", EDGE, panel=panel, legend=False)
    name = "95 % band" if panel == 1 else ""
    above = line(w, high, name, EDGE, panel=panel, legend=panel == 1)
    return [below, {**above, "fill": "tonexty", "fillcolor": FILL}]


def margin_words(found: FrequencyCase) -> list[str]:
    """Margins of the recommended settings straight from the measured points, in words.

    Parameters
    ----------
    found : FrequencyCase
        The measured response with margins.
    """
    if found.margins is None:
        return []
    said = []
    for name, value, unit in (
        ("gain margin", found.margins.gain, ""),
        ("phase margin", found.margins.phase, "°"),
        ("Ms", found.margins.Ms, ""),
    ):
        if value is not None:
            middle, low, high = (digits(number, 3) for number in value)
            said.append(f"{name} {middle}{unit} ({low} to {high})")
    words = [f"Margins without a model: {', '.join(said)}."] if said else []
    return [*words, *(f"{remark[:1].upper()}{remark[1:]}." for remark in found.margins.remarks)]
