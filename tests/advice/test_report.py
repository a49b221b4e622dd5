"""The report: one page that fetches nothing, escapes everything, and draws what it says."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from advice.report.page import report_page, write_report
from advice.tune import TuningCase, tune, tune_process
from loop.controller import PID
from loop.margins import margins
from loop.plants import PLANT, relay_test
from loop.process import FOPDT, IPDT
from loop.record import Record


@pytest.fixture(scope="module")
def case(heater_test: Record) -> TuningCase:
    return tune(heater_test, running=PID(Kc=1.0, Ti=60.0))


def figures(page: str) -> dict[str, Any]:
    found = re.search(r"^const figures = (.*);$", page, re.MULTILINE)
    assert found is not None
    drawn: dict[str, Any] = json.loads(found[1])
    return drawn


def without_scripts(page: str) -> str:
    return re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)


def test_the_page_holds_every_picture_the_case_can_have(case: TuningCase) -> None:
    drawn = figures(report_page(case, title="TIC-900"))

    assert list(drawn) == [
        "fit",
        "residual",
        "bode",
        "nyquist",
        "setpoint",
        "load",
        "fan_setpoint",
        "fan_load",
        "sweep",
    ]
    for figure in drawn.values():
        axes = [axis for name, axis in figure["layout"].items() if re.match("[xy]axis", name)]
        titles = [axis["title"]["text"] for axis in axes]
        assert any("[" in title for title in titles)
        assert all(trace["x"] and len(trace["x"]) == len(trace["y"]) for trace in figure["data"])


def test_the_page_fetches_nothing(case: TuningCase) -> None:
    page = without_scripts(report_page(case, title="TIC-900"))

    assert "<link" not in page
    assert not re.search(r"""\b(src|href)\s*=""", page)


def test_names_from_a_file_cannot_become_markup(heater_test: Record) -> None:
    hostile = "</script><script>alert(1)</script>"
    record = Record(
        t=heater_test.t, pv=heater_test.pv, op=heater_test.op, pv_unit=hostile, tag=hostile
    )
    page = report_page(tune(record), title=hostile)

    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page


def test_the_nyquist_curve_is_the_loop_and_the_circle_is_the_limit(case: TuningCase) -> None:
    data = {
        trace["name"]: trace for trace in figures(report_page(case, title="x"))["nyquist"]["data"]
    }
    limit = [
        ((x + 1) ** 2 + y**2) ** 0.5
        for x, y in zip(data["Ms = 2"]["x"], data["Ms = 2"]["y"], strict=True)
    ]
    assert limit == pytest.approx([0.5] * len(limit), abs=1e-6)
    curve = data["recommended"]
    nearest = min(
        ((x + 1) ** 2 + y**2) ** 0.5
        for x, y in zip(curve["x"], curve["y"], strict=True)
        if x is not None
    )
    assert case.best is not None
    assert case.best.proposal.pid is not None
    assert case.process is not None
    assert 1 / nearest == pytest.approx(margins(case.process, case.best.proposal.pid).Ms, rel=0.01)


def test_set_point_and_load_responses_end_where_they_must(case: TuningCase) -> None:
    drawn = figures(report_page(case, title="x"))
    at_sp = {t["name"]: t for t in drawn["setpoint"]["data"] if t["yaxis"] == "y"}
    assert at_sp["recommended"]["y"][-1] == pytest.approx(at_sp["set point"]["y"][0], rel=0.05)
    load = next(t for t in drawn["load"]["data"] if t["name"] == "recommended")
    assert abs(load["y"][-1]) < 0.1 * max(abs(y) for y in load["y"])


def test_a_refusal_and_a_bare_process_make_pages_too(
    flat_record: Record, square_wave: Record, tmp_path: Path
) -> None:
    refused = report_page(tune(flat_record), title="flat")
    assert "No recommendation" in refused
    assert figures(refused) == {}

    file = tmp_path / "report.html"
    write_report(tune_process(IPDT(K=0.01, theta=10.0)), file, title="LIC-1")
    assert list(figures(file.read_text("utf-8"))) == [
        "bode", "nyquist", "setpoint", "load", "fan_setpoint", "fan_load", "sweep",
    ]  # fmt: skip
    relay = report_page(tune(square_wave), title="relay")
    assert "Ku" in relay
    assert "not verified" in relay
    modelled = report_page(tune(relay_test(PLANT[3])), title="relay")
    assert "by describing function, off by" in modelled


def test_an_unstable_running_controller_has_no_response_to_draw() -> None:
    case = tune_process(FOPDT(K=2.0, tau=120.0, theta=30.0), running=PID(Kc=50.0, Ti=10.0))
    drawn = figures(report_page(case, title="x"))

    names = [trace["name"] for trace in drawn["setpoint"]["data"]]
    assert "running now" not in names
    assert "running now" in [trace["name"] for trace in drawn["nyquist"]["data"]]
