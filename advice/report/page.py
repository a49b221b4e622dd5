"""One self-contained HTML page for a tuning case: numbers, figures, reasons, nothing to fetch."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TypeAlias

from jinja2 import Environment, PackageLoader, StrictUndefined

from advice.analyse import Task
from advice.display import decibels, digits, row_of, rule_name, settings_of
from advice.facts import data_facts, gain_unit, model_facts, op_unit, pv_unit
from advice.next_test import after, next_test_sentences
from advice.report.analysis_section import analysis_of, analysis_sections
from advice.report.fan_figures import fan_figures
from advice.report.fit_figures import fit, residual
from advice.report.frequency_figures import frequency_sections
from advice.report.loop_figures import (
    Candidate,
    Course,
    bode,
    load_courses,
    nyquist,
    responses,
    set_point_courses,
    sweep,
)
from advice.report.robust_section import optimal_section, proof_section
from advice.report.section import Section, Table, section
from advice.robust_choice import CaseProof, OptimalChoice
from advice.tune import TuningCase
from loop.measures import load_measures, step_measures

More: TypeAlias = Sequence[tuple[str, Sequence[str]]]

READING = (
    "Gain margin (GM), phase margin (PM), delay margin and Ms are computed with the exact dead "
    "time, without a Padé approximation. A rule passes when the profile's limits hold at the model "
    "and with each parameter of the model off by up to ±50 %, one at a time, in eleven steps. "
    "Worst Ms is the largest Ms over that sweep. Settings are in the ISA standard form, "
    "Kc (1 + 1/(Ti s) + Td s/(1 + Td s/N)); convert them to your controller's form before typing. "
    "Loopwright never writes to a controller."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a page shows beside the case itself.

    Attributes
    ----------
    task : Task or None
        What the loop has to do; the load of the drawn responses if not given.
    scan_time : float
        Scan time of the controller. [s]
    proof : CaseProof or None
        Proofs over the box of model errors.
    choices : sequence of OptimalChoice or None
        Optimal settings.
    more : sequence of (str, sequence of str)
        Further sections: a heading and its sentences. Empty ones are left out.
    """

    task: Task | None = None
    scan_time: float = 0.0
    proof: CaseProof | None = None
    choices: Sequence[OptimalChoice] | None = None
    more: More = ()


def write_report(
    case: TuningCase,
    file: Path,
    *,
    title: str,
    generated: str = "",
    asked: Asked | None = None,
) -> None:
    """Write the page to a file.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    file : Path
        Where to write; an existing file is replaced.
    title : str
        Name of the loop or of the file.
    generated : str
        When and by whom, in words; empty for neither.
    asked : Asked, optional
        What to show beside the case itself.
    """
    page = report_page(case, title=title, generated=generated, asked=asked)
    file.write_text(page, encoding="utf-8")


def report_page(
    case: TuningCase, *, title: str, generated: str = "", asked: Asked | None = None
) -> str:
    """Make the page.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    title : str
        Name of the loop or of the file.
    generated : str
        When and by whom, in words; empty for neither.
    asked : Asked, optional
        What to show beside the case itself.
    """
    wanted, following = asked or Asked(), after(case)
    sections, further = [*sections_of(case), *_analysed(case, wanted)], _asked_for(case, wanted)
    numbered = {
        item["id"]: item["figure"]
        for part in (*sections, *further)
        for item in part["figures"]  # type: ignore[attr-defined]
    }
    template = _templates().get_template("page.html.j2")
    return template.render(
        title=title,
        subtitle=" · ".join(filter(None, (f"Profile {case.profile.name}", generated))),
        best=_best(case),
        reason=case.recommended_reason,
        data=[] if case.record is None else data_facts(case.record),
        model=[fact for fact in model_facts(case) if fact[0] != "because"],
        model_reasons=[text for name, text in model_facts(case) if name == "because"],
        next_test=[] if following is None else next_test_sentences(following),
        sections=sections,
        further=further,
        responses=_response_table(case),
        rows=[
            row_of(t, best=i == case.recommended)
            for i, t in enumerate(case.tunings)
            if t.proposal.pid is not None
        ],
        rows_caption=(
            f"Profile {case.profile.name}: gain margin at least {decibels(case.profile.gain)} dB, "
            f"phase margin {case.profile.phase:.3g}°, Ms at most {case.profile.Ms:.3g}."
        ),
        refusals=[t.proposal.refusal for t in case.tunings if t.proposal.pid is None],
        unit_gain=gain_unit(case.record),
        reading=READING,
        script=_plotly(),
        # "<" could end the script element early, whatever a tag or a unit holds.
        figures_json=json.dumps(numbered, allow_nan=False).replace("<", "\\u003c"),
    )


def _analysed(case: TuningCase, wanted: Asked) -> list[Section]:
    """The recommended loop analysed, with the load of the drawn responses if none was stated."""
    task = wanted.task or Task(load=event_sizes(case)[1])
    found = analysis_of(case, task=task, scan_time=wanted.scan_time)
    return [] if found is None else analysis_sections(found)


def _asked_for(case: TuningCase, wanted: Asked) -> list[Section]:
    best = case.best
    sections = []
    if wanted.proof is not None:
        sections.append(proof_section(wanted.proof))
    if wanted.choices is not None:
        sections.append(
            optimal_section(wanted.choices, None if best is None else best.proposal.pid)
        )
    sections += [section(title, {}, sentences=said) for title, said in wanted.more if said]
    return sections


@cache
def _templates() -> Environment:
    return Environment(
        loader=PackageLoader("advice", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


@cache
def _plotly() -> str:
    """The drawing script as the plotly package carries it."""
    return (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


def _best(case: TuningCase) -> Section | None:
    best = case.best
    if best is None or best.proposal.pid is None:
        return None
    return {
        "name": rule_name(best.proposal),
        "action": best.proposal.pid.action.value,
        "settings": settings_of(best.proposal.pid, gain_unit(case.record)),
    }


def candidates_of(case: TuningCase) -> list[Candidate]:
    """The controllers to draw: the recommended one, and the one that runs now."""
    shown = []
    if case.best is not None and case.best.proposal.pid is not None:
        shown.append(Candidate(name="recommended", pid=case.best.proposal.pid))
    if case.running is not None and case.running_verification is not None:
        shown.append(Candidate(name="running now", pid=case.running))
    return shown


def sections_of(case: TuningCase) -> list[Section]:
    """Draw every figure of a case, section by section."""
    sections = []
    if case.model is not None and case.record is not None and case.model.process is not None:
        drawn = {
            "fit": (fit(case.record, case.model), "The record and the model's answer to OP."),
            "residual": (
                residual(case.record, case.model),
                "PV less model: what the model does not explain.",
            ),
        }
        sections.append(section("Fit", drawn))
    sections += frequency_sections(case)
    shown = candidates_of(case)
    if case.process is None or not shown:
        return sections
    drawn = {
        "bode": (bode(case.process, shown), "Bode plot of L, exact dead time."),
        "nyquist": (
            nyquist(case.process, shown, case.profile.Ms),
            f"Nyquist plot; L stays outside the circle where Ms is below {case.profile.Ms:g}.",
        ),
    }
    sections.append(section("Loop", drawn))
    pv, op = pv_unit(case.record), op_unit(case.record)
    set_point, load = event_sizes(case)
    stable = _stable(case, shown)
    if stable:
        at_sp = set_point_courses(case.process, stable, set_point)
        at_load = load_courses(case.process, stable, load)
        drawn = {
            "setpoint": (
                responses(at_sp, pv=pv, op=op, size=set_point),
                f"Set-point step of {digits(set_point, 3)} {pv}.",
            ),
            "load": (
                responses(at_load, pv=pv, op=op),
                f"Load step of {digits(load, 3)} {op} at the process input.",
            ),
        }
        sections.append(section("Responses", drawn))
        fans = fan_figures(case, stable, set_point=set_point, load=load, pv=pv)
        if fans:
            sections.append(section("Responses on uncertain processes", fans))
    if case.best is not None and case.best.verification is not None:
        caption = "Margins of the recommended settings when one parameter of the model is off."
        drawn = {"sweep": (sweep(case.best.verification, case.profile), caption)}
        sections.append(section("±50 % sweep", drawn))
    return sections


def _stable(case: TuningCase, shown: Sequence[Candidate]) -> list[Candidate]:
    """An unstable loop has no response worth a picture."""
    running = case.running_verification
    return [c for c in shown if c.name == "recommended" or (running is not None and running.stable)]


def event_sizes(case: TuningCase) -> tuple[float, float]:
    """Set-point step [PV] and load step [OP] to simulate, 1 where no test tells a size.

    A tenth of the test's largest move stays well within the limits that the simulation leaves out.
    """
    model = case.model
    if model is not None and model.process is not None and model.steps:
        op = 0.1 * max(abs(reading.step.size) for reading in model.steps)
        gain = model.process.numerator[-1] / (model.process.denominator[-1] or 1.0)
        return abs(gain) * op, op
    return 1.0, 1.0


def _response_table(case: TuningCase) -> Table | None:
    shown = _stable(case, candidates_of(case))
    if case.process is None or not shown:
        return None
    set_point, load = event_sizes(case)
    rows = []
    for at_sp, at_load in zip(
        set_point_courses(case.process, shown, set_point),
        load_courses(case.process, shown, load),
        strict=True,
    ):
        rows.append(_measures(at_sp, at_load, set_point))
    pv, op = pv_unit(case.record), op_unit(case.record)
    head = (
        "Controller",
        "Rise 10-90 % [s]",
        "Overshoot [%]",
        "Settling 2 % [s]",
        f"Set-point IAE [{pv} s]",
        f"Load peak [{pv}]",
        f"Load IAE [{pv} s]",
        f"Output travel at set point [{op}]",
    )
    return Table(
        head=head,
        rows=tuple(rows),
        caption="Simulated on the model, without noise or limits.",
    )


def _measures(at_sp: Course, at_load: Course, set_point: float) -> tuple[str, ...]:
    r, d = at_sp.response, at_load.response
    step = step_measures(r.t, r.pv, r.op, sp=set_point, pv0=0.0, op_before=0.0)
    load = load_measures(d.t, d.pv, d.op, sp=0.0, op_before=0.0)
    return (
        at_sp.name,
        digits(step.rise_time, 3),
        digits(step.overshoot, 3),
        digits(step.settling_time, 3),
        digits(step.IAE, 3),
        digits(load.peak_deviation, 3),
        digits(load.IAE, 3),
        digits(step.total_variation, 3),
    )
