"""`loopwright compare`: two periods of a file."""

import json
from pathlib import Path

import numpy as np
import pytest

from monitoring.before_after import before_after
from service.cli import run

ROWS = 1200


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A loop whose error is halved after ten hours."""
    size = np.where(np.arange(ROWS) < ROWS // 2, 2.0, 1.0)
    pv = 50 + size * np.random.default_rng(1).normal(size=ROWS)
    stamps = np.datetime64("2026-01-31T00:00:00") + np.arange(ROWS).astype("timedelta64[m]")
    rows = [f"{at}Z,{value:.9f},50,40,AUTO" for at, value in zip(stamps, pv, strict=True)]
    path = tmp_path / "both.csv"
    path.write_text("\n".join(["time,T.PV,T.SP,T.OP,T.MODE", *rows]), "utf-8")
    return path


BEFORE = ["--before", "2026-01-31T00:00:00Z..2026-01-31T10:00"]
AFTER = ["--after", "2026-01-31T10:00:00..2026-01-31T20:00:00Z"]


def test_two_periods_of_a_file_are_compared(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", str(file), *BEFORE, *AFTER]) == 0
    said = capsys.readouterr().out
    assert said.startswith("The control error afterwards: better\nIts root mean square is 0.5")
    assert "In control for 100% of the time before, 100% after" in said

    assert (
        run(["compare", str(file), "--before", "0..36000", "--after", "36000..72000", "--json"])
        == 0
    )
    found = json.loads(capsys.readouterr().out)["comparison"]
    size = np.where(np.arange(ROWS) < ROWS // 2, 2.0, 1.0)
    error = -size * np.random.default_rng(1).normal(size=ROWS)
    direct = before_after(error[:600], error[600:])
    assert found["change"] == "better"
    assert found["ratio"] == pytest.approx(direct.ratio)
    assert found["high"] == pytest.approx(direct.high)


def test_periods_too_short_to_tell_are_refused_with_the_reason(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", str(file), "--before", "0..300", *AFTER]) == 3
    assert "fewer than 10" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("period", "sentence"),
    [
        ("0", "a period is FROM..TO"),
        ("5..2", "a period ends after it begins"),
        ("noon..later", "an instant is such as"),
        ("9e6..9.1e6", "no sample lies within"),
    ],
)
def test_a_wrong_period_is_told_in_a_sentence(
    file: Path, period: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", str(file), "--before", period, *AFTER]) == 2
    assert sentence in capsys.readouterr().err


def test_a_file_with_elapsed_time_knows_no_instants(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "elapsed.csv"
    rows = [f"{k},{50 + k % 3},50,40" for k in range(100)]
    path.write_text("\n".join(["time,pv,sp,op", *rows]), "utf-8")
    assert run(["compare", str(path), *BEFORE, "--after", "0..50"]) == 2
    assert "state seconds" in capsys.readouterr().err
