"""`loopwright assess`: files, folders and the installation, in words and as a document."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sqlalchemy import URL

from advice.assess import assess
from advice.assessment_body import assessment_body
from historian.samples import Samples
from loop.controller import PID
from loop.digital_pid import OutputLimits
from loop.process import FOPDT
from monitoring.known_loop import KnownLoop
from service.actors import Actor, Role
from service.cli import run
from service.database import Database
from service.keys.actions import create_key
from service.loops.actions import create_loop
from service.loops.schemas import NewLoop
from service.samples import open_samples
from service.settings import Settings
from tests.service.conftest import TIC101

ROWS = 720


def signals(*, seed: int = 1) -> Samples:
    noise = np.random.default_rng(seed).normal(size=ROWS)
    pv = 50.0 + np.convolve(noise, 0.8 ** np.arange(30), "same")
    return Samples(
        time=np.datetime64("2026-01-31T00:00:00", "us") + np.arange(ROWS).astype("timedelta64[m]"),
        pv=pv,
        sp=np.full(ROWS, 50.0),
        op=40.0 - 0.5 * (pv - 50.0),
        mode=np.ones(ROWS, np.int8),
    )


def parquet(folder: Path, name: str, samples: Samples) -> None:
    time = pa.array(samples.time).cast(pa.timestamp("us")).cast(pa.int64())
    columns = {
        "time": time.cast(pa.timestamp("us", "UTC")),
        "pv": samples.pv, "sp": samples.sp, "op": samples.op, "mode": ["AUTO"] * len(samples),
    }  # fmt: skip
    pq.write_table(pa.table(columns), folder / f"{name}.parquet")


def csv(file: Path, samples: Samples) -> Path:
    rows = zip(samples.time, samples.pv, samples.sp, samples.op, strict=True)
    lines = [f"{time}Z,{pv!r},{sp!r},{op!r},AUTO" for time, pv, sp, op in rows]
    text = "\n".join(["time,TIC-1.PV,TIC-1.SP,TIC-1.OP,TIC-1.MODE", *lines])
    file.write_text(text.replace("np.float64(", "").replace(")", ""), "utf-8")
    return file


def test_the_same_data_give_the_same_document_from_csv_and_parquet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    samples = signals()
    parquet(tmp_path, "TIC-1", samples)
    found = []
    for source in (csv(tmp_path / "routine.csv", samples), tmp_path, tmp_path / "TIC-1.parquet"):
        options = ["--kind", "temperature", "--pv-low", "0", "--pv-high", "200", "--json"]
        assert run(["assess", str(source), *options]) == 0
        found.append(json.loads(capsys.readouterr().out))

    assert found[0]["assessments"][0]["tag"] == "TIC-1"
    assert found[0]["assessments"][0]["kind"] == "temperature"
    assert found[1] == found[2]
    # An export has no time zone inside the store, but everything that was computed is the same.
    for name in ("diagnosis", "grade", "indices"):
        assert found[0]["assessments"][0][name] == found[1]["assessments"][0][name]


def test_a_stated_model_says_more_about_the_loop_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    samples = signals()
    file = csv(tmp_path / "routine.csv", samples)
    stated = ["--model", "FOPDT:1,600,240", "--settings", "0.5,600", "--tau-c", "300"]
    stated += ["--scan-time", "60"]
    assert run(["assess", str(file), *stated, "--limit-high", "50", "--json"]) == 0
    indices = json.loads(capsys.readouterr().out)["assessments"][0]["indices"]
    assert indices["error"]["outside"] == pytest.approx(np.mean(samples.pv > 50))
    control = indices["control"]
    known = KnownLoop(
        process=FOPDT(K=1.0, tau=600.0, theta=240.0),
        controller=PID(Kc=0.5, Ti=600.0),
        limits=OutputLimits(low=0.0, high=100.0),
        scan_time=60.0,
    )
    record = samples.record(tag="TIC-1")
    alone = assessment_body(assess(record, known=known, tau_c=300.0))
    assert control == alone["indices"]["control"]  # type: ignore[index,call-overload]
    assert control["model"]["mismatch"]["verdict"] == "undecided"
    assert control["desired_settling"]["tau_c"] == 300.0

    parquet(tmp_path, "TIC-1", samples)
    parquet(tmp_path, "TIC-2", samples)
    assert run(["assess", str(tmp_path), *stated]) == 2
    assert "--model belongs to one loop" in capsys.readouterr().err


def test_the_worst_loop_comes_first_with_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parquet(tmp_path, "TIC-GOOD", signals())
    bad = signals(seed=2)
    stuck = Samples(time=bad.time, pv=bad.pv, sp=bad.sp, op=np.full(ROWS, 100.0), mode=bad.mode)
    parquet(tmp_path, "TIC-STUCK", stuck)

    assert run(["assess", str(tmp_path)]) == 0
    heading, first, second, *_, total, causes = capsys.readouterr().out.strip().splitlines()
    assert heading.split()[:3] == ["Loop", "Grade", "Cause"]
    assert (first.split()[0], second.split()[0]) == ("TIC-STUCK", "TIC-GOOD")
    assert total.startswith("Loops: 2, assessable: 2, mean grade")
    assert causes.startswith("Causes: 1 ")


def test_causes_that_are_left_open_are_named_beside_the_likeliest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moving = signals(seed=2)
    still = Samples(
        time=moving.time, pv=np.full(ROWS, 50.0), sp=moving.sp,
        op=np.linspace(20.0, 40.0, ROWS), mode=moving.mode,
    )  # fmt: skip
    parquet(tmp_path, "FIC-STILL", still)

    assert run(["assess", str(tmp_path)]) == 0
    assert "sensor or valve" in capsys.readouterr().out


def test_a_day_of_the_installation_is_assessed_and_kept(
    sqlite_url: URL,
    data_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = Settings(data=data_folder)
    held = Database.at(sqlite_url)
    with held.transaction() as session:
        key, token = create_key(session, owner="Anna", role=Role.ENGINEER)
        actor = Actor(owner=key.owner, role=Role.ENGINEER)
        loop = create_loop(session, actor=actor, loop=NewLoop.model_validate(TIC101))
    open_samples(settings).write(loop.id, signals())
    held.engine.dispose()
    monkeypatch.setenv("LOOPWRIGHT_KEY", token)

    where = ["--processes", "1", "--data", str(data_folder)]
    assert run(["assess", "--day", "2026-01-31", *where]) == 0
    assert "TIC-101" in capsys.readouterr().out
    assert run(["assess", "--day", "2026-02-01", *where]) == 3
    assert "Loops: 0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "state --day, or a file or folder to assess"),
        (["nowhere.csv"], "there is no file nowhere.csv"),
        (["nowhere.csv", "--pv-low", "0"], "state both --pv-low and --pv-high, or neither"),
        (["x.csv", "--settings", "1,2"], "--settings and --scan-time need the --model"),
        (["x.csv", "--model", "IPDT:1,2", "--scan-time", "0"], "--scan-time must lie within"),
        (["x.csv", "--limit-low", "9", "--limit-high", "5"], "--limit-high must be above"),
        (["x.csv", "--tau-c", "0"], "--tau-c must lie within"),
        (["--tau-c", "9", "--day", "2026-01-31"], "belong to a file"),
    ],
)
def test_a_wrong_call_is_told_in_a_sentence(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["assess", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_a_folder_without_parquet_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["assess", str(tmp_path)]) == 1
    assert "There is no Parquet file below" in capsys.readouterr().err


def test_a_file_that_gives_no_record_costs_the_other_loops_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parquet(tmp_path, "TIC-GOOD", signals())
    parquet(tmp_path, "TIC-NONE", signals().between(0, 0))
    (tmp_path / "TIC-BROKEN.parquet").write_text("not Parquet")

    assert run(["assess", str(tmp_path), "--json"]) == 0
    found = {one["tag"]: one for one in json.loads(capsys.readouterr().out)["assessments"]}
    assert found["TIC-GOOD"]["assessable"]
    for tag, why in (("TIC-NONE", "holds no samples"), ("TIC-BROKEN", "cannot be read as Parquet")):
        assert not found[tag]["assessable"]
        assert found[tag]["diagnosis"]["cause"] == "not assessable"
        assert why in found[tag]["diagnosis"]["evidence"][0]
    (tmp_path / "TIC-GOOD.parquet").unlink()
    assert run(["assess", str(tmp_path)]) == 3
    assert "TIC-BROKEN" in capsys.readouterr().out
    assert run(["assess", str(tmp_path / "TIC-BROKEN.parquet")]) == 1
