"""Reading historian exports against pandas, pyarrow and polars, in four layouts."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TypeAlias

from benchmarks.csv_pipelines import PIPELINES
from benchmarks.exports import LAYOUTS, write_export
from benchmarks.section import Section, Target

Reading: TypeAlias = dict[str, float]
SIZE = 100_000_000
MEGABYTE = 1e6
ROUNDS = 3
# On a busy machine a layout gets fewer rounds, and the last ones none, rather than the run being
# stopped without a result.
LONGEST, LONGEST_OF_ALL = 30.0, 220.0
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS")


def read_apart(library: str, layout: str, path: Path, *, one_thread: bool) -> Reading:
    """Read a file in a process of its own.

    Parameters
    ----------
    library, layout : str
        Keys of the pipelines and of the layouts.
    path : Path
        File to read.
    one_thread : bool
        Work on one thread; otherwise on as many as the library takes.

    Raises
    ------
    subprocess.SubprocessError
        The pipeline failed.
    """
    environment = {name: value for name, value in os.environ.items() if name not in THREADS}
    if one_thread:
        environment |= dict.fromkeys(THREADS, "1")
    command = [sys.executable, "-m", "benchmarks.csv_pipelines", library, layout, str(path)]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    reading: Reading = json.loads(done.stdout)
    return reading


def _same(reading: Reading, reference: Reading) -> str:
    """Compare what was read: equal up to the rounding of a sum, or not."""
    for name in ("values", "sum", "stamps", "rejected"):
        if abs(reading[name] - reference[name]) > 1e-9 * abs(reference[name]):
            return f"no: {name} {reading[name]:.10g}, not {reference[name]:.10g}"
    return "yes"


def _measure(layout: str, path: Path) -> tuple[dict[str, list[Reading]], dict[str, list[Reading]]]:
    single: dict[str, list[Reading]] = {library: [] for library in PIPELINES}
    free: dict[str, list[Reading]] = {library: [] for library in PIPELINES}
    start = time.perf_counter()
    for turn in range(ROUNDS):
        if turn and time.perf_counter() - start > LONGEST:
            break
        for library in PIPELINES:
            single[library].append(read_apart(library, layout, path, one_thread=True))
    for library in PIPELINES:
        free[library].append(read_apart(library, layout, path, one_thread=False))
    return single, free


def _median(readings: list[Reading], name: str) -> float:
    return median(reading[name] for reading in readings)


def compare(layout: str, path: Path) -> tuple[list[tuple[str, ...]], list[Target]]:
    """Read one file all ways: rows of the table, and the targets on speed and memory.

    Parameters
    ----------
    layout : str
        Key of the layouts.
    path : Path
        File of that layout.
    """
    name = LAYOUTS[layout].name
    size = path.stat().st_size
    single, free = _measure(layout, path)
    reference = single["polars"][0]
    rows: list[tuple[str, ...]] = []
    for library, readings in single.items():
        peak = max(reading["peak"] for reading in readings)
        best = min(reading["work"] for reading in readings)
        free_best = min(reading["seconds"] for reading in free[library])
        rows.append(
            (
                f"{name}, {size / MEGABYTE:.0f} MB",
                library,
                f"{size / MEGABYTE / _median(readings, 'work'):.0f} ({size / MEGABYTE / best:.0f})",
                f"{size / MEGABYTE / free_best:.0f}",
                f"{peak / MEGABYTE:.0f}",
                f"{readings[0]['bare'] / MEGABYTE:.0f}",
                _same(readings[0], reference),
            )
        )
    if OURS not in single:
        return rows, []
    peers = [library for library in single if library != OURS]
    fastest = min(peers, key=lambda library: _median(single[library], "work"))
    peak = max(reading["peak"] for reading in [*single[OURS], *free[OURS]])
    return rows, [
        Target(
            what=f"{name}, time against the fastest ({fastest})",
            limit=1.3,
            reached=_median(single[OURS], "work") / _median(single[fastest], "work"),
            unit="times",
        ),
        Target(
            what=f"{name}, peak memory less twice the file",
            limit=200.0,
            reached=(peak - 2 * size) / MEGABYTE,
            unit="MB",
        ),
    ]


OURS = "Loopwright"


def run() -> Section:
    """Write and read a file of each layout."""
    rows, targets = [], []
    left_out: tuple[str, ...] = ()
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="loopwright-bench-") as folder:
        for layout in LAYOUTS:
            if time.perf_counter() - start > LONGEST_OF_ALL:
                left_out += (f"{LAYOUTS[layout].name} was left out: the machine was too busy.",)
                continue
            path = Path(folder) / f"{layout}.csv"
            write_export(path, LAYOUTS[layout], size=SIZE)
            more_rows, more_targets = compare(layout, path)
            rows += more_rows
            targets += more_targets
            path.unlink()
    return Section(
        title="Reading historian exports",
        how=(
            "12 tags of four loops at 1 s, 0.1 % bad words in four spellings, a few stamps that "
            "are no time. Delivered: each signal's UTC stamps and values with the bad words as "
            "gaps, and the lines without a time. MB/s with one thread by processor time, "
            f"median of {ROUNDS} (best); MB/s with all threads by wall time, once; peak "
            "resident memory of the process, and what its imports take. The same contents: number "
            "and sum of the values, sum of their stamps, number of rejected lines."
        ),
        columns=(
            "file",
            "by",
            "MB/s, one thread",
            "MB/s, all threads",
            "peak [MB]",
            "imports [MB]",
            "same contents",
        ),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            *left_out,
            "The libraries are told delimiter, layout, time format and bad words; Loopwright "
            "finds them out by itself. A bad word that was not told makes pandas return a column "
            "of text, pyarrow fail and polars fail or return text.",
            "The libraries hand over single signals. Loopwright hands over loops: PV, SP and OP "
            "on one time axis, sorted, duplicates removed, every row accounted for with the line "
            "number and the reason of each rejection.",
            "pandas parses DD-MMM-YY by regular expression, once for each distinct stamp where "
            "stamps repeat.",
        ),
    )
