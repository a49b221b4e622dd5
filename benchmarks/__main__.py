"""Run the benchmarks, each in a process of its own, and save what they found.

Exit code 0 when every benchmark ran, whatever its times; 1 when one did not.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.catalogue import BENCHMARKS
from benchmarks.results import Result, load, page, save
from benchmarks.section import as_text
from benchmarks.surroundings import surroundings

ROOT = Path(__file__).resolve().parent.parent
SAVED = ROOT / "benchmarks" / "results.json"
PAGE = ROOT / "docs" / "benchmarks.md"
THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS")


def measure_apart(name: str) -> Result:
    """Run one benchmark in a process of its own.

    Parameters
    ----------
    name : str
        Key of the catalogue.

    Raises
    ------
    subprocess.SubprocessError
        It failed, or took longer than it may.
    """
    around = surroundings()
    with tempfile.TemporaryDirectory(prefix="loopwright-bench-") as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, "-m", "benchmarks", name, "--into", str(answer)]
        # What it leaves behind if it is stopped lies in this folder and in its own session.
        environment = {**os.environ, **dict.fromkeys(THREAD_LIMITS, "1"), "TMPDIR": folder}
        process = subprocess.Popen(command, cwd=ROOT, env=environment, start_new_session=True)
        try:
            code = process.wait(timeout=BENCHMARKS[name].seconds)
        except BaseException:
            _end_session(process)
            raise
        if code:
            raise subprocess.CalledProcessError(code, command)
        body = json.loads(answer.read_text(encoding="utf-8"))
    return Result.from_json({"section": body, "surroundings": dict(around)})


def _end_session(process: subprocess.Popen[bytes]) -> None:
    """End a benchmark that still runs, with the server that it may have started."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _measure_all(names: list[str]) -> list[str]:
    failed = []
    for name in names:
        print(f"{name}: {BENCHMARKS[name].about} ...", flush=True)
        try:
            result = measure_apart(name)
        except subprocess.SubprocessError as problem:
            print(f"{name} gave no result: {problem}", file=sys.stderr)
            failed.append(name)
            continue
        print(as_text(result.section), flush=True)
        results = {**load(SAVED), name: result}
        ordered = {key: results[key] for key in BENCHMARKS if key in results}
        save(SAVED, ordered)
        PAGE.write_text(page(ordered), encoding="utf-8")
    return failed


def main(arguments: list[str] | None = None) -> int:
    """Read the command line and run what it asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="benchmarks to run; default all")
    parser.add_argument("--list", action="store_true", help="name the benchmarks and stop")
    parser.add_argument("--into", type=Path, metavar="FILE", help="run one here, write its JSON")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"no benchmark is called {unknown[0]}; choose from {', '.join(BENCHMARKS)}")
    if given.list:
        for benchmark in BENCHMARKS.values():
            print(f"{benchmark.name:15} {benchmark.about}")
        return 0
    if given.into:
        if len(given.names) != 1:
            parser.error("--into takes exactly one benchmark")
        section = BENCHMARKS[given.names[0]].run()
        given.into.write_text(json.dumps(section.to_json()), encoding="utf-8")
        return 0
    failed = _measure_all(given.names or list(BENCHMARKS))
    if failed:
        print(f"without result: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
