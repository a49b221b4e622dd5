"""`loopwright plantwide`: an export, Parquet files and folders give the API's document."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from advice.plantwide import plant_oscillations
from advice.plantwide_body import plantwide_body
from historian.csv_file import read_export
from loop.signals import Real
from service.cli import run
from service.plantwide.schemas import PlantOscillationsBody

ROWS = 700
TAGS = ("TIC-1", "FIC-2", "PIC-3")


def signals() -> dict[str, Real]:
    """Two loops of one swing, and one that rests."""
    rng = np.random.default_rng(1)
    swing = np.sin(2 * np.pi * np.cumsum(1 + 0.1 * rng.normal(size=ROWS)) / 30)
    parts = (np.roll(swing, 4), -2 * swing, np.zeros(ROWS))
    return {
        tag: 50 + part + 0.2 * rng.normal(size=ROWS) for tag, part in zip(TAGS, parts, strict=True)
    }


@pytest.fixture
def export(tmp_path: Path) -> Path:
    stamps = np.datetime64("2026-01-31T00:00:00") + np.arange(ROWS).astype("timedelta64[m]")
    head = ",".join(f"{tag}.PV,{tag}.SP,{tag}.OP" for tag in TAGS)
    columns = signals()
    lines = [
        f"{stamp}Z,"
        + ",".join(f"{columns[tag][k]:.9f},50,{90 - columns[tag][k]:.9f}" for tag in TAGS)
        for k, stamp in enumerate(stamps)
    ]
    file = tmp_path / "export.csv"
    file.write_text("\n".join([f"time,{head}", *lines]), "utf-8")
    return file


def test_an_export_and_a_folder_give_the_document_of_the_api(
    export: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plantwide", str(export), "--json"]) == 0
    body = json.loads(capsys.readouterr().out)
    read = read_export(export)
    records = [read.record(tag) for tag in TAGS]
    found = plant_oscillations(records)
    assert body == plantwide_body(found)
    assert body == PlantOscillationsBody.model_validate(found).model_dump(mode="json")
    assert {one["tag"] for one in body["groups"][0]["suspects"]} == {"TIC-1", "FIC-2"}

    for record in records:
        stamps = np.arange(ROWS) * 60_000_000 + 1_769_817_600_000_000
        columns = {
            "time": pa.array(stamps).cast(pa.timestamp("us", "UTC")),
            "pv": record.pv, "sp": record.sp, "op": record.op,
        }  # fmt: skip
        pq.write_table(pa.table(columns), export.parent / f"{record.tag}.parquet")
    files = [str(export.parent / f"{tag}.parquet") for tag in TAGS]
    for sources in ([str(export.parent)], files[::-1]):
        assert run(["plantwide", *sources, "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == body


def test_in_words_it_says_who_swings_together_and_what_that_rests_on(
    export: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plantwide", str(export)]) == 0
    said = capsys.readouterr().out
    assert "2 loops oscillate together, period" in said
    assert re.search(r"^1\. +(TIC-1|FIC-2) +\d+% +its valve", said, re.MULTILINE)


def test_a_level_must_be_one_of_the_loops(export: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plantwide", str(export), "--level", "LIC-9"]) != 0
    assert "LIC-9 is none of the loops" in capsys.readouterr().err


def test_one_loop_alone_is_refused_with_the_reason(
    export: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plantwide", str(export), "--tag", "TIC-1"]) == 3
    said = capsys.readouterr().out
    assert "No loops oscillate together." in said
    assert "Left out: TIC-1: no time in common with the others." in said
    assert run(["plantwide", str(export.parent / "nothing.csv")]) == 2
