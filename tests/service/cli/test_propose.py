"""`loopwright propose`: a stated process in, the document of the API out, or sentences."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from advice.case_body import case_body
from advice.robust_body import robust_body
from advice.robust_choice import prove_case
from advice.tune import tune_process
from loop.process import FOPDT, IPDT, TransferFunction
from service.cli import run

Said = Callable[[], tuple[str, str]]
COLUMN = "TF:-0.3,1/0.8,3.2,3.4,1,0.5"


def test_the_json_is_the_document_of_the_api(said: Said) -> None:
    assert run(["propose", "IPDT:-0.01,30", "--json", "--profile", "process"]) == 0
    case = tune_process(IPDT(K=-0.01, theta=30.0), profile="process")
    assert json.loads(said()[0]) == json.loads(json.dumps(case_body(case)))


def test_the_text_shows_the_reduction_and_the_recommendation(said: Said) -> None:
    assert run(["propose", COLUMN, "--running", "0.5,2.5"]) == 0
    out = said()[0]
    assert "FOPDT by the half rule" in out
    assert "the zero (-0.3 s + 1) to the dead time, 0.3 s" in out
    process = TransferFunction((-0.3, 1.0), (0.8, 3.2, 3.4, 1.0), 0.5)
    assert tune_process(process).recommended_reason in out


def test_a_report_with_its_proof_is_written(tmp_path: Path, said: Said) -> None:
    file = tmp_path / "page.html"
    call = ["propose", "FOPDT:2,120,30", "--proof", "--load", "10", "--allowed", "3", "--json"]
    assert run([*call, "--report", str(file)]) == 0
    case = tune_process(FOPDT(K=2, tau=120, theta=30))
    proof = prove_case(case)
    body = case_body(case) | robust_body(proof, None)
    assert json.loads(said()[0]) == json.loads(json.dumps(body))
    page = file.read_text(encoding="utf-8")
    assert "<html" in page[:200]
    assert "<h2>Proof</h2>" in page
    assert "at least 4.424 with any controller" in page


def test_an_unstable_process_is_refused_with_the_reason(said: Said) -> None:
    assert run(["propose", "TF:1/-3,1,0.5"]) == 3
    out, told = said()
    assert out == ""
    assert told == (
        "Tuning by a published rule does not apply: the process is unstable "
        "(1 pole in the right half-plane).\n"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["FOPDT:2,120,nan"], "theta must be 0 or within"),
        (["FOPDT:2,-120,30"], "tau must lie within"),
        (["TF:1,1,1/1,1,1"], "must be proper"),
        (["FOPDT:2,120,30", "--tau-c", "-3"], "tau_c must lie within"),
        (["FOPDT:2,120,30", "--scan-time", "-1"], "sample_time must lie within"),
        (["FOPDT:2,120,30", "--profile", "bold"], "--profile must be one of"),
        (["FOPDT:2,120,30", "--running", "x"], "numbers separated by commas"),
    ],
)
def test_a_wrong_call_is_one_sentence_and_exit_code_2(
    said: Said, arguments: list[str], words: str
) -> None:
    assert run(["propose", *arguments]) == 2
    assert words in said()[1]
