"""A tuning case as one A4 page, for the folder and the change board."""

import json
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from pathlib import Path

import typst

from advice.body import Json
from advice.display import Row, decibels, row_of, rule_name, settings_of
from advice.facts import data_facts, gain_unit, model_facts
from advice.report.drawing import Figure
from advice.report.page import READING, sections_of
from advice.report.still import still
from advice.tune import TuningCase

# mm on paper; a column is half of what A4 leaves, and five pictures and a table fill the page.
SIZES = {
    "fit": (88.0, 46.0), "nyquist": (88.0, 46.0), "setpoint": (88.0, 46.0), "load": (88.0, 46.0),
    "sweep": (180.0, 36.0),
}  # fmt: skip
MOST_ROWS = 9
BECAUSE = "because"  # what `model_facts` calls a reason of the verdict
COLUMNS = (
    "Rule", "Kc", "Ti [s]", "Td [s]", "GM [dB]", "PM [°]", "DM [s]", "Ms", "worst Ms", "±50 %"
)  # fmt: skip
# A time of making would make equal cases unequal files.
STAMP = datetime(2026, 1, 1, tzinfo=UTC)


def write_pdf(case: TuningCase, file: Path, *, title: str, generated: str = "") -> None:
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
    """
    file.write_bytes(case_pdf(case, title=title, generated=generated))


def case_pdf(case: TuningCase, *, title: str, generated: str = "") -> bytes:
    """Set the page.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    title : str
        Name of the loop or of the file.
    generated : str
        When and by whom, in words; empty for neither.

    Returns
    -------
    bytes
        A PDF of one page, the same for the same case.
    """
    words = json.dumps(_words(case, title, generated), allow_nan=False)
    made = typst.compile(
        _template(),
        format="pdf",
        sys_inputs={"case": words},
        timestamp=STAMP,
        ignore_system_fonts=True,  # only what comes along, so that every machine sets the same page
    )
    if not isinstance(made, bytes):
        raise TypeError("a page of a report must be one document")
    return made


@cache
def _template() -> bytes:
    return (files("advice") / "report" / "one_page.typ").read_bytes()


def _words(case: TuningCase, title: str, generated: str) -> dict[str, Json]:
    rows = _rows(case)
    left_out = sum(t.proposal.pid is not None for t in case.tunings) - len(rows)
    return {
        "title": title,
        "subtitle": " · ".join(filter(None, (f"Profile {case.profile.name}", generated))),
        **_headline(case),
        "reason": case.recommended_reason,
        "model": [[name, value] for name, value in model_facts(case) if name != BECAUSE],
        "because": [value for name, value in model_facts(case) if name == BECAUSE],
        "data": [] if case.record is None else [[n, v] for n, v in data_facts(case.record)],
        "figures": _figures(case),
        "columns": list(COLUMNS),
        "rows": [{"best": row.best, "cells": _cells(row)} for row in rows],
        "rows_title": "Settings, ISA form",
        "rows_note": (
            f"Profile {case.profile.name}: gain margin at least {decibels(case.profile.gain)} dB, "
            f"phase margin {case.profile.phase:.3g}°, Ms at most {case.profile.Ms:.3g}."
            + (f" {left_out} more structures are in the full report." if left_out else "")
        ),
        "reading": READING,
    }


def _headline(case: TuningCase) -> dict[str, Json]:
    best = case.best
    if best is None or best.proposal.pid is None:
        return {"headline": "No recommendation", "settings": ""}
    pid = best.proposal.pid
    settings = ", ".join(settings_of(pid, gain_unit(case.record)))
    return {
        "headline": f"Recommended: {rule_name(best.proposal)}",
        "settings": f"{settings}, {pid.action.value} action",
    }


def _rows(case: TuningCase) -> list[Row]:
    """The recommended settings first, then those that pass, then the others, as the page holds."""
    found = [
        row_of(tuning, best=i == case.recommended)
        for i, tuning in enumerate(case.tunings)
        if tuning.proposal.pid is not None
    ]
    return sorted(found, key=lambda row: (not row.best, row.verdict != "passes"))[:MOST_ROWS]


def _cells(row: Row) -> list[Json]:
    return [
        row.name, row.Kc, row.Ti, row.Td, row.gain, row.phase, row.delay, row.Ms, row.worst_Ms,
        row.verdict,
    ]  # fmt: skip


def _figures(case: TuningCase) -> dict[str, Json]:
    drawn: dict[str, Json] = {}
    for section in sections_of(case):
        for item in section["figures"]:  # type: ignore[attr-defined]
            figure: Figure = item["figure"]
            if item["id"] in SIZES:
                width, height = SIZES[item["id"]]
                drawn[item["id"]] = {
                    "svg": still(figure, width=width, height=height).decode(),
                    "caption": item["caption"],
                }
    return drawn
