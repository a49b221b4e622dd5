"""The report: one page that fetches nothing, escapes everything, and draws what it says."""

import html
import json
import re
from pathlib import Path
from typing import Any

import pytest

from advice.analyse import Task
from advice.analysis_words import limit_words, loop_words, pole_words
from advice.display import digits
from advice.report.analysis_section import analysis_of
from advice.report.loop_figures import sweep
from advice.report.page import Asked, event_sizes, report_page, write_report
from advice.robust_choice import optimal_choices, prove_case
from advice.tune import TuningCase, tune, tune_process
from loop.controller import PID
from loop.margins import margins
from loop.plants import PLANT, relay_test
from loop.process import FOPDT, IPDT, SOPDT
from loop.record import Record


@pytest.fixture(scope="module")
def case(heater_test: Record) -> TuningCase:
    return tune(heater_test, running=PID(Kc=1.0, Ti=60.0))


@pytest.fixture(scope="module")
def page(case: TuningCase) -> str:
    return report_page(case, title="TIC-900")


def figures(page: str) -> dict[str, Any]:
    found = re.search(r"^const figures = (.*);$", page, re.MULTILINE)
    assert found is not None
    drawn: dict[str, Any] = json.loads(found[1])
    return drawn


def without_scripts(page: str) -> str:
    return re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)


def test_the_page_holds_every_picture_the_case_can_have(page: str) -> None:
    drawn = figures(page)

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
        "sensitivities",
        "nichols",
        "root_locus",
    ]
    for figure in drawn.values():
        axes = [axis for name, axis in figure["layout"].items() if re.match("[xy]axis", name)]
        titles = [axis["title"]["text"] for axis in axes]
        assert any("[" in title for title in titles)
        assert all(trace["x"] and len(trace["x"]) == len(trace["y"]) for trace in figure["data"])


def test_the_page_fetches_nothing(page: str) -> None:
    assert "<link" not in without_scripts(page)
    assert not re.search(r"""\b(src|href)\s*=""", without_scripts(page))


def test_the_recommended_loop_is_analysed(case: TuningCase, page: str) -> None:
    load = event_sizes(case)[1]
    found = analysis_of(case, task=Task(load=load))
    assert found is not None
    text = html.unescape(without_scripts(page))
    for sentences in (loop_words(found), pole_words(found), limit_words(found)):
        assert sentences
        for sentence in sentences:
            assert sentence in text
    assert f"A load of {load:.4g} moves PV by at least" in text
    assert "A PID is enough" in text
    S = next(t for t in figures(page)["sensitivities"]["data"] if t["name"] == "|S|")
    assert found.margins is not None
    assert max(S["y"]) == pytest.approx(found.margins.Ms, rel=1e-3)
    here = next(t for t in figures(page)["root_locus"]["data"] if t["name"] == "poles at k = 1")
    assert found.poles is not None
    assert here["x"] == pytest.approx(found.poles.poles.real.tolist(), rel=1e-6)


def test_what_was_asked_for_stands_on_the_page(case: TuningCase) -> None:
    proof, choices = prove_case(case), optimal_choices(case)
    assert proof is not None
    assert choices is not None
    asked = Asked(
        task=Task(load=10.0, allowed=3.0),
        proof=proof,
        choices=choices,
        more=[("Remarks", ["Said <here>."]), ("Nothing", [])],
    )
    page = report_page(case, title="x", asked=asked)
    text = html.unescape(without_scripts(page))
    assert "The allowed 3 cannot be kept by feedback." in text
    assert "What would help: feed-forward of the load" in text
    best = proof.settings[0]
    assert f"Recommended settings: {best.largest.sentence}" in text
    assert digits(best.proof.worst["Ms"].bound) in text
    assert "PID over what the record leaves open" in text
    assert "Said &lt;here&gt;." in page
    assert "Nothing" not in text
    front = {t["name"]: t for t in figures(page)["front"]["data"] if t["mode"] == "lines"}
    for choice in choices:
        assert choice.front is not None
        area = [point.load_IAE for point in choice.front.points]
        assert front[choice.structure]["y"] == pytest.approx(area, rel=1e-6)


def test_names_from_a_file_cannot_become_markup(heater_test: Record) -> None:
    hostile = "</script><script>alert(1)</script>"
    record = Record(
        t=heater_test.t, pv=heater_test.pv, op=heater_test.op, pv_unit=hostile, tag=hostile
    )
    page = report_page(tune(record), title=hostile)

    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page


def test_the_nyquist_curve_is_the_loop_and_the_circle_is_the_limit(
    case: TuningCase, page: str
) -> None:
    data = {trace["name"]: trace for trace in figures(page)["nyquist"]["data"]}
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


def test_set_point_and_load_responses_end_where_they_must(page: str) -> None:
    drawn = figures(page)
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
        "sensitivities", "nichols", "root_locus",
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


def test_every_parameter_of_the_sweep_is_drawn() -> None:
    case = tune_process(SOPDT(K=2.0, tau1=30.0, tau2=10.0, theta=5.0))
    assert case.best is not None
    assert case.best.verification is not None
    drawn = sweep(case.best.verification, case.profile)["data"]
    assert isinstance(drawn, list)
    named = {trace["name"] for trace in drawn if isinstance(trace, dict)}
    assert {f"error of {name}" for name in ("K", "tau1", "tau2", "theta")} <= named
