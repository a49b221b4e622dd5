"""An analysis as the JSON document that the command line prints and the API answers.

Numbers keep full precision. null stands for infinite and for what does not exist; complex numbers
are lists of real and of imaginary parts.
"""

from dataclasses import asdict

import numpy as np

from advice.analyse import Analysis
from advice.body import (
    Body,
    Json,
    margins_body,
    number,
    numbers,
    process_body,
    profile_body,
    settings_body,
)
from advice.report.analysis_figures import analysis_figures
from loop.closed_loop_poles import ClosedLoopPoles
from loop.errors import INFINITELY_MANY
from loop.frequency_curves import FrequencyCurves, sensitivity_circle
from loop.root_locus import RootLocus
from loop.signals import Complex


def analysis_body(analysis: Analysis, *, figures: bool = True) -> Body:
    """The whole analysis: margins, responses, poles, locus, limits, answers to the task.

    Parameters
    ----------
    analysis : Analysis
        What `advice.analyse` answered.
    figures : bool
        Whether to add Plotly documents.
    """
    known, nyquist, routh, bode = (
        analysis.margins,
        analysis.nyquist,
        analysis.routh,
        analysis.bode,
    )
    infinite = analysis.unstable == INFINITELY_MANY
    body: Body = {
        "process": process_body(analysis.process),
        "controller": settings_body(analysis.controller),
        "compensators": [
            {"kind": type(item).__name__, **asdict(item)} for item in analysis.compensators
        ],
        "scan_time": analysis.scan_time,
        "profile": profile_body(analysis.profile),
        "stable": known is not None,
        "unstable_poles": None if infinite else analysis.unstable,
        "margins": None if known is None else margins_body(known),
        "passes": analysis.passes,
        "bandwidths": {k: number(v) for k, v in asdict(analysis.bandwidths).items()},
        "hidden_poles": [item.sentence for item in analysis.stability.cancellations],
        "nyquist": None if nyquist is None else asdict(nyquist),
        "curves": _curves_body(analysis.curves),
        "sensitivity_circle": _parts(sensitivity_circle(analysis.profile.Ms)),
        "poles": None if analysis.poles is None else _poles_body(analysis.poles),
        "root_locus": None if analysis.locus is None else _locus_body(analysis.locus),
        "routh": None
        if routh is None
        else {
            "pade_order": analysis.pade_order,
            "rows": [list(row) for row in routh.rows],
            "right": routh.right,
            "axis": routh.axis,
            "zero_rows": list(routh.zero_rows),
            "zero_pivots": list(routh.zero_pivots),
        },
        "bode_integral": None if bode is None else asdict(bode),
        "limits": [
            {
                "bound": limit.bound.value,
                "value": number(limit.value),
                "cause": limit.cause,
                "rigorous": limit.rigorous,
                "sentence": limit.sentence,
            }
            for limit in analysis.limits
        ],
        "fastest_crossover": number(analysis.fastest),
        "feasibility": None
        if analysis.feasibility is None
        else _said(asdict(analysis.feasibility)),
        "lowest_peak": None if analysis.peak is None else _said(asdict(analysis.peak)),
        "crossover_window": None if analysis.window is None else _said(asdict(analysis.window)),
        "disturbances": [_said(asdict(item)) for item in analysis.disturbances],
        "beyond_pid": _said(asdict(analysis.beyond)),
        "notes": list(analysis.notes),
    }
    if figures:
        body["figures"] = dict(analysis_figures(analysis))
    return body


def _curves_body(curves: FrequencyCurves) -> Body:
    """Frequency responses as columns; the four closed-loop ones by their size."""
    return {
        "w": numbers(curves.w),
        "gain": numbers(np.abs(curves.L)),
        "phase": numbers(curves.phase),
        "real": numbers(curves.L.real),
        "imag": numbers(curves.L.imag),
        "S": numbers(np.abs(curves.S)),
        "T": numbers(np.abs(curves.T)),
        "GS": numbers(np.abs(curves.GS)),
        "CS": numbers(np.abs(curves.CS)),
    }


def _parts(values: Complex) -> Body:
    return {"real": numbers(values.real), "imag": numbers(values.imag)}


def _poles_body(found: ClosedLoopPoles) -> Body:
    return {
        **_parts(found.poles),
        "residual": numbers(found.residual),
        "rectangle": None if found.rectangle is None else asdict(found.rectangle),
    }


def _locus_body(found: RootLocus) -> Body:
    return {
        "k": numbers(found.k),
        "branches": [_parts(branch) for branch in found.branches.T],
        "open_loop_poles": _parts(found.poles),
        "open_loop_zeros": _parts(found.zeros),
        "crossings": [{"k": k, "w": w} for k, w in found.crossings],
        "rectangle": asdict(found.rectangle),
    }


def _said(value: object) -> Json:
    """Plain values of a result, nested as they are."""
    match value:
        case dict():
            return {str(name): _said(item) for name, item in value.items()}
        case list() | tuple():
            return [_said(item) for item in value]
        case bool() | str() | None:
            return value
        case int():
            return value
        case float():
            return number(value)
        case _:
            raise TypeError(f"{type(value).__name__} has no place in a body")
