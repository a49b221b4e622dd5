"""The A4 page: one page whatever the case, the same file for the same case, readable words."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import typst

from advice.report import one_page
from advice.report.drawing import STRONG, Axis, line, stacked
from advice.report.one_page import case_pdf
from advice.report.still import still
from advice.tune import TuningCase, tune, tune_process
from historian.csv_file import read_export
from loop.controller import PID
from loop.process import FOPDT
from loop.record import Record

STEP = Path(__file__).parents[2] / "docs" / "tutorial" / "heater-step.csv"


@pytest.fixture(scope="module")
def case() -> TuningCase:
    record = read_export(STEP).record()
    return tune(record, running=PID(Kc=0.5, Ti=100.0, Td=10.0))


def refused() -> TuningCase:
    flat = np.full(100, 50.0)
    return tune(Record(t=np.arange(100.0), pv=flat, op=flat))


def pages(pdf: bytes) -> int:
    found = re.search(rb"/Type\s*/Pages\b[^>]*?/Count\s+(\d+)", pdf, re.DOTALL) or re.search(
        rb"/Count\s+(\d+)", pdf
    )
    assert found is not None
    return int(found[1])


def test_a_case_is_one_page_and_the_same_file_every_time(case: TuningCase) -> None:
    pdf = case_pdf(case, title="TIC-900", generated="2026-01-31 by Anna")
    assert pdf.startswith(b"%PDF-")
    assert pages(pdf) == 1
    assert pdf == case_pdf(case, title="TIC-900", generated="2026-01-31 by Anna")


@pytest.mark.parametrize(
    "other",
    [refused(), tune_process(FOPDT(K=2.0, tau=120.0, theta=30.0))],
    ids=["refused", "a stated process"],
)
def test_a_case_without_model_or_data_is_one_page_too(other: TuningCase) -> None:
    assert pages(case_pdf(other, title='<b>"#x" \\ $tag$')) == 1


def test_the_page_says_what_the_case_says(case: TuningCase) -> None:
    words = one_page._words(case, "TIC-900", "")
    best = case.best
    assert best is not None
    assert str(words["headline"]).startswith("Recommended: SIMC PI")
    assert words["reason"] == case.recommended_reason
    assert set(words["figures"]) == set(one_page.SIZES)
    assert "Kc = 0.82" in str(words["settings"])


def test_words_are_set_and_never_run(case: TuningCase) -> None:
    """A tag is data: what Typst would take for code comes out as it was typed."""
    words = one_page._words(case, '#panic("run")', "")
    made = typst.compile(
        one_page._template(),
        format="svg",
        sys_inputs={"case": json.dumps(words)},
        ignore_system_fonts=True,
    )
    assert made is not None


def test_a_still_picture_has_no_time_and_no_text_to_miss_a_font() -> None:
    figure = stacked(
        [line(np.arange(3.0), np.array([1.0, np.nan, 3.0]), "a", STRONG)],
        Axis(title="Time [s]"),
        [Axis(title="PV [degC]", log=True, span=(0.1, 10.0))],
    )
    drawn = still(figure, width=80.0, height=40.0)
    assert drawn == still(figure, width=80.0, height=40.0)
    assert b"<text" not in drawn
    assert b"<dc:date>" not in drawn
