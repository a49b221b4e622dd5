"""The harness on toy work; no time is asserted, and no peer is needed."""

import json
import math
import subprocess
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import benchmarks.__main__ as command
from benchmarks.catalogue import BENCHMARKS, Benchmark
from benchmarks.csv_pipelines import contents, with_loopwright
from benchmarks.exact_margins import Plant, exact_margins
from benchmarks.exports import BAD_WORDS, BROKEN_STAMP, LAYOUTS, write_export
from benchmarks.results import Result, load, page, save
from benchmarks.section import Section, Target, as_markdown, as_text
from benchmarks.surroundings import surroundings
from benchmarks.timing import duration, interleaved

MET = Target(what="speed", limit=10.0, reached=12.0, unit="times", at_least=True)
MISSED = Target(what="memory", limit=500.0, reached=812.0, unit="MB")


def toy(*targets: Target) -> Section:
    return Section(
        title="Toy",
        how="Counted on fingers.",
        columns=("by", "time"),
        rows=(("us", "1 ms"), ("a peer", "2 ms")),
        targets=targets,
        notes=("The peer has eight fingers.",),
    )


def count_slowly(calls: list[str], name: str) -> None:
    calls.append(name)
    assert sum(math.sqrt(x) for x in range(60_000)) > 0


def test_works_take_turns_however_little_time_is_given() -> None:
    calls: list[str] = []
    works = {name: partial(count_slowly, calls, name) for name in ("a", "b")}
    timings = interleaved(works, repeats=4, seconds=0.0)
    assert list(timings) == ["a", "b"]
    assert all(timing.repeats == 3 for timing in timings.values())  # never fewer than three
    assert all(0 < timing.best <= timing.median for timing in timings.values())
    assert "".join(calls[4:]).count("ab") >= 3


def test_short_work_is_called_often_enough_to_be_measured() -> None:
    calls: list[int] = []
    interleaved({"short": lambda: calls.append(1)}, repeats=3)
    assert len(calls) > 100


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(1.5, "1.5 s"), (0.0123, "12.3 ms"), (4.567e-5, "45.7 µs"), (8e-8, "80 ns")],
)
def test_a_time_is_written_with_a_unit_that_suits_it(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_a_target_says_whether_it_is_met() -> None:
    assert MET.met
    assert not MISSED.met
    assert str(MET) == "speed: 12 times (target at least 10 times): met"
    assert str(MISSED) == "memory: 812 MB (target at most 500 MB): **missed**"


def test_a_row_of_another_width_is_refused() -> None:
    with pytest.raises(ValueError, match="2 columns"):
        Section(title="T", how="H", columns=("a", "b"), rows=(("one",),))


def test_markdown_and_text_hold_every_cell_and_note() -> None:
    for written in (as_markdown(toy(MET)), as_text(toy(MET))):
        for word in ("Toy", "fingers", "a peer", "2 ms", "eight fingers", "target at least 10"):
            assert word in written
    assert "| us | 1 ms |" in as_markdown(toy())


def test_results_come_back_from_their_file(tmp_path: Path) -> None:
    result = Result(section=toy(MET, MISSED), surroundings=surroundings())
    save(tmp_path / "results.json", {"toy": result})
    assert load(tmp_path / "results.json") == {"toy": result}
    assert load(tmp_path / "absent.json") == {}


def test_the_page_puts_missed_targets_first_and_names_machine_and_versions() -> None:
    result = Result(section=toy(MET, MISSED), surroundings=surroundings())
    written = page({"toy": result})
    assert "1 of 2 targets are met" in written
    assert written.index("- Toy: memory: 812 MB") < written.index("## Toy")
    assert result.surroundings["processor"] in written
    assert f"numpy {np.__version__}" in written


def test_the_list_names_every_benchmark(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["--list"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in BENCHMARKS)


def test_an_unknown_benchmark_is_refused_with_the_choice(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        command.main(["marginss"])
    assert "choose from margins" in capsys.readouterr().err


def test_all_benchmarks_together_end_within_forty_minutes() -> None:
    assert sum(benchmark.seconds for benchmark in BENCHMARKS.values()) <= 40 * 60


def test_one_benchmark_writes_its_section_where_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("benchmarks.catalogue.Benchmark.run", lambda _: toy(MET))
    assert command.main(["margins", "--into", str(tmp_path / "answer.json")]) == 0
    body = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    assert Section.from_json(body) == toy(MET)


def test_a_benchmark_that_takes_too_long_is_stopped_with_what_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = tmp_path / "started"
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\nsleep 300 &\necho $! > {started}\nwait\n", encoding="ascii")
    program.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(program))
    short = Benchmark(name="margins", about="", seconds=2.0)
    monkeypatch.setattr(command, "BENCHMARKS", {"margins": short})
    with pytest.raises(subprocess.TimeoutExpired):
        command.measure_apart("margins")
    sleeper = int(started.read_text(encoding="ascii"))
    deadline = time.monotonic() + 20
    while is_running(sleeper) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not is_running(sleeper)


def is_running(pid: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_the_exact_margins_meet_the_printed_anchors() -> None:
    heater = Plant(K=2, tau1=120, theta=30, Kc=0.45, Ti=135, Td=13.3)
    expected = (7.28357, 84.2356, 219.311, 1.16282, 1.0)
    assert exact_margins(heater) == pytest.approx(expected, rel=5e-6)
    integrator = Plant(K=1, tau1=0, integrators=1, theta=1, Kc=0.5, Ti=8)
    assert exact_margins(integrator) == pytest.approx((2.963, 46.86, 1.590, 1.704, 1.299), rel=5e-4)


@pytest.mark.parametrize("name", list(LAYOUTS))
def test_the_reader_delivers_what_the_export_was_written_with(name: str, tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    rows = write_export(path, LAYOUTS[name], rows=2_400, block=1_200)
    assert rows == 2_400
    lines = path.read_text(encoding="ascii").splitlines()
    broken = [number for number, line in enumerate(lines, 1) if BROKEN_STAMP in line]
    good = [line for line in lines[1:] if BROKEN_STAMP not in line]
    cells = [cell for line in good for cell in line.split(",")[2 if "long" in name else 1 :]]
    numbers = [float(cell) for cell in cells if cell not in BAD_WORDS]
    found = contents(with_loopwright(path, LAYOUTS[name]))
    assert len(broken) == 2
    assert found["values"] == len(numbers)
    assert found["sum"] == pytest.approx(math.fsum(numbers), rel=1e-12)
    assert found["rejected"] == len(broken)
