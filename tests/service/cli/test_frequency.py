"""`loopwright frequency`: from a file as from a notebook, and a sentence where it cannot."""

import json
from pathlib import Path

import numpy as np
import pytest

from advice.frequency import frequency_body, frequency_case
from historian.csv_file import read_export
from loop.controller import PID
from loop.margins import margins
from loop.open_loop import process_output
from loop.process import FOPDT
from service.cli import run

PLANT = FOPDT(K=2.0, tau=20.0, theta=5.0)


@pytest.fixture
def test_file(tmp_path: Path) -> Path:
    t = 0.5 * np.arange(4000)
    op = 40 + 5 * np.concatenate([np.sin(w * t[:800]) for w in (0.03, 0.07, 0.15, 0.3, 0.5)])
    noise = np.random.default_rng(0).normal(0, 0.05, t.size)
    pv = process_output(PLANT, t, op - 40) + 80 + noise
    rows = [f"{a},{b:.6f},{c:.6f}" for a, b, c in zip(t, pv, op, strict=True)]
    file = tmp_path / "sines.csv"
    file.write_text("\n".join(["t [s],PV,OP", *rows]), "utf-8")
    return file


def test_the_document_is_that_of_a_notebook_and_near_the_truth(
    test_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["frequency", str(test_file), "--controller", "0.5,20,0", "--json"]) == 0
    body = json.loads(capsys.readouterr().out)
    pid = PID(Kc=0.5, Ti=20.0, Td=0.0)
    assert body == frequency_body(frequency_case(read_export(test_file).record(), pid))

    model, true = body["model"], margins(PLANT, pid)
    for value, error, name in zip(
        (model["K"], model["tau"], model["theta"]), model["standard_errors"], ("K", "tau", "theta"),
        strict=True,
    ):  # fmt: skip
        assert abs(value - getattr(PLANT, name)) < 4 * error, name
    for name, value in (("gain", true.gain), ("phase", true.phase)):
        assert body["margins"][name]["value"] == pytest.approx(value, rel=0.05)


def test_a_person_reads_points_model_and_margins(
    test_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["frequency", str(test_file), "--controller", "0.5,20,0"]) == 0
    said = capsys.readouterr().out
    assert "|G| [PV/OP]" in said
    assert "Model: K 2." in said
    assert "gain margin: " in said


def test_a_record_without_moves_is_refused_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "flat.csv"
    rows = "".join(f"{i},{20 + i % 3},40\n" for i in range(300))
    file.write_text(f"t [s],PV,OP\n{rows}", "utf-8")
    assert run(["frequency", str(file)]) == 3
    assert capsys.readouterr().out.startswith("Refused: ")


def test_settings_that_cannot_be_are_told(
    test_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["frequency", str(test_file), "--controller", "fast"]) == 2
    assert "--controller takes KC,TI,TD" in capsys.readouterr().err
