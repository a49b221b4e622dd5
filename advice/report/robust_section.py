"""Proofs over the box and optimal settings in a page: tables, and the front from calm to fast."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from advice.display import digits
from advice.report.drawing import (
    ACCENT,
    INK,
    Axis,
    Figure,
    Look,
    line,
    points,
    side_by_side,
)
from advice.report.section import Section, Table, section
from advice.robust_body import TITLES, UNITS, joint_words
from advice.robust_choice import CaseProof, OptimalChoice
from loop.controller import PID
from tuning.optimal_search import OptimalSettings, Structure

LOOKS = {"PI": Look(INK, "solid", 1.8), "PID": Look(ACCENT, "dash", 2.0)}
COLORS = {"PI": INK, "PID": ACCENT}


def proof_section(proof: CaseProof) -> Section:
    """Show what is proven over ±50 % of all parameters at once.

    Parameters
    ----------
    proof : CaseProof
        What `advice.robust_choice.prove_case` answered.
    """
    head = ["Margin"]
    for proven in proof.settings:
        head += [f"{proven.name}: found", "proven bound"]
    rows = []
    for name, title in TITLES.items():
        unit = UNITS[name].strip()
        row = [f"{title} [{unit}]" if unit else f"{title} [-]"]
        for proven in proof.settings:
            case = proven.proof.worst.get(name)
            row += ["–", "–"] if case is None else [digits(case.found), digits(case.bound)]
        rows.append(tuple(row))
    table = Table(
        head=tuple(head),
        rows=tuple(rows),
        caption="Worst over ±50 % of all parameters at once: the worst plant found, and the bound "
        "that no plant of the box passes.",
    )
    said = []
    for proven in proof.settings:
        name = proven.name[0].upper() + proven.name[1:]
        said += [
            f"{name} settings: {proven.largest.sentence}",
            f"{name} settings: {proven.proof.certificate}",
        ]
    said += joint_words(proof)
    return section("Proof", {}, tables=[table] if proof.settings else [], sentences=said)


def optimal_section(choices: Sequence[OptimalChoice], recommended: PID | None) -> Section:
    """Show the settings of least load area, and what speed costs.

    Parameters
    ----------
    choices : sequence of OptimalChoice
        What `advice.robust_choice.optimal_choices` answered.
    recommended : PID, optional
        The recommended settings, for the caption.
    """
    rows = []
    for choice in choices:
        name = choice.structure
        if choice.over_box is not None:
            held = "proven" if choice.over_box.verdict.holds else "not proven"
            rows.append(_row(f"{name} over ±50 % of all", choice.over_box.settings, held))
        if choice.over_draws is not None:
            part = choice.over_draws
            held = f"{100 * part.at_least:.0f} % at least"
            rows.append(_row(f"{name} over what the record leaves open", part.settings, held))
        if choice.front is not None:
            rows += [
                _row(f"{name} at the model, Ms {point.margins.Ms:.2f}", point, "")
                for point in choice.front.points
            ]
    table = Table(
        head=("Least load area", "Kc", "Ti [s]", "Td [s]", "Load IAE", "Ms", "Holds"),
        rows=tuple(rows),
        caption="Settings of least load area (unit load step at the process input, N = 10); Ms at "
        "the model.",
    )
    fronts = {c.structure: c.front.points for c in choices if c.front is not None}
    figures = {}
    if fronts:
        caption = "What speed costs: load area against Ms at the model, from calm to fast"
        if recommended is not None:
            caption += f"; the recommended settings have Ti/Kc = {digits(_area(recommended), 3)}"
        figures["front"] = (_front(fronts), f"{caption}.")
    refusals = [text for choice in choices for text in choice.refusals]
    return section("Optimal settings", figures, tables=[table] if rows else [], sentences=refusals)


def _row(name: str, found: OptimalSettings, held: str) -> tuple[str, ...]:
    pid = found.pid
    return (
        name,
        digits(pid.Kc),
        digits(pid.Ti),
        digits(pid.Td) if pid.Td else "–",
        digits(found.load_IAE),
        digits(found.margins.Ms, 3),
        held,
    )


def _area(pid: PID) -> float:
    return pid.Ti / pid.Kc if pid.Ti < math.inf else math.inf


def _front(fronts: Mapping[Structure, tuple[OptimalSettings, ...]]) -> Figure:
    traces = []
    for structure, settings in fronts.items():
        Ms = np.array([found.margins.Ms for found in settings])
        area = np.array([found.load_IAE for found in settings])
        traces.append(line(Ms, area, structure, LOOKS[structure]))
        traces.append(points(Ms, area, structure, color=COLORS[structure], size=7))
        traces[-1]["showlegend"] = False
    panel = (Axis(title="Ms at the model [-]"), Axis(title="Load IAE [PV s/OP]", log=True))
    return side_by_side(traces, [panel], height=340)
