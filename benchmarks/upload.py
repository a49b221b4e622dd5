"""Five million rows of one loop, end to end through HTTP into the sample store."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.csv_pipelines import peak_memory, with_pandas
from benchmarks.exports import ISO, Layout, write_export
from benchmarks.section import Section, Target
from benchmarks.server import Server, server
from benchmarks.timing import duration

ROWS = 5_000_000
LIMIT = 500.0
MEGABYTE = 1e6
LAYOUT = Layout(
    name="one loop", long=False, stamps=ISO, tags=("FIC-100.PV", "FIC-100.SP", "FIC-100.OP")
)
LONG = Layout(name="one loop, long", long=True, stamps=ISO, tags=LAYOUT.tags)
LOOP: dict[str, str | float] = {
    "tag": "FIC-100",
    "pv_low": 0.0,
    "pv_high": 100.0,
    "pv_unit": "m3/h",
    "action": "reverse",
    "form": "isa",
    "time_unit": "s",
    "gain_basis": "eu",
}


def _upload(running: Server, path: Path) -> tuple[float, int, str]:
    """Send the file: time until it is stored [s], samples stored, address of its samples."""
    answer = running.client.post("/v1/loops", json=LOOP).raise_for_status()
    address = f"/v1/loops/{answer.json()['id']}"
    start = time.perf_counter()
    with path.open("rb") as file:
        stored = running.client.post(f"{address}/records", files={"file": (path.name, file)})
    seconds = time.perf_counter() - start
    return seconds, int(stored.raise_for_status().json()["samples"]), f"{address}/samples"


def _long(folder: Path) -> tuple[float, ...]:
    """Send a long file: rows, size [byte], time [s], memory before and peak [byte]."""
    path = folder / "long.csv"
    rows = write_export(path, LONG, rows=ROWS)
    data = folder / "data-long"
    data.mkdir()
    with server(data) as running:
        before = running.memory()
        seconds, samples, _ = _upload(running, path)
        peak = running.peak_memory()
    assert samples > 0.999 * rows / len(LONG.tags), f"{samples} samples stored of {rows} rows"
    return rows, path.stat().st_size, seconds, before, peak


def _with_pandas_and_deltalake(path: Path, table: Path) -> None:
    """Read with pandas' C engine and write a Delta table, as a script of ten lines would."""
    import pyarrow as pa
    from deltalake import write_deltalake

    delivery = with_pandas(path, LAYOUT)
    stamps = delivery.signals[LAYOUT.tags[0]][0]
    columns = {"time": pa.array(stamps)}
    columns |= {tag: pa.array(values) for tag, (_, values) in delivery.signals.items()}
    write_deltalake(str(table), pa.table(columns))


def _peer(path: Path, table: Path) -> tuple[float, float]:
    """Time [s] and peak memory [bytes] of the peer, in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.upload", str(path), str(table)]
    done = subprocess.run(command, env=os.environ, stdout=subprocess.PIPE, text=True, check=True)
    body = json.loads(done.stdout)
    return float(body["seconds"]), float(body["peak"])


def run() -> Section:
    """Upload once, look at the memory of the server, and read samples back."""
    with tempfile.TemporaryDirectory(prefix="loopwright-bench-") as folder:
        path = Path(folder) / "export.csv"
        rows = write_export(path, LAYOUT, rows=ROWS)
        size = path.stat().st_size
        data = Path(folder) / "data"
        data.mkdir()
        with server(data) as running:
            before = running.memory()
            seconds, samples, address = _upload(running, path)
            peak = running.peak_memory()
            start = time.perf_counter()
            seen = running.client.get(address, params={"max_points": 2_000}).raise_for_status()
            shown = time.perf_counter() - start
            all_there = int(seen.json()["samples"])
        peer_seconds, peer_peak = _peer(path, Path(folder) / "table")
        path.unlink()
        long_rows, long_size, long_seconds, long_before, long_peak = _long(Path(folder))
    broken = -(-rows // 240_000)
    assert samples == rows - broken, f"{samples} samples stored of {rows} rows"
    return Section(
        title="Upload of five million rows",
        how=(
            f"One file of {rows:,} rows ({size / MEGABYTE:.0f} MB: stamp, PV, SP, OP; 0.1 % bad "
            f"words, {broken} broken stamps) sent to a server of one process and stored; time "
            "until the answer says so, peak resident memory of the server (its imports included), "
            "and all of it read back as a picture of 2,000 points a signal. Then as many rows as a "
            f"long file of {long_size / MEGABYTE:.0f} MB (stamp, tag, value; three tags)."
        ),
        columns=("by", "time", "rows/s", "peak [MB]", "before [MB]", "read back"),
        rows=(
            (
                "Loopwright, through HTTP",
                duration(seconds),
                f"{rows / seconds:,.0f}",
                f"{peak / MEGABYTE:.0f}",
                f"{before / MEGABYTE:.0f}",
                f"{all_there:,} samples in {duration(shown)}",
            ),
            (
                "Loopwright, long file",
                duration(long_seconds),
                f"{long_rows / long_seconds:,.0f}",
                f"{long_peak / MEGABYTE:.0f}",
                f"{long_before / MEGABYTE:.0f}",
                "",
            ),
            (
                "pandas and deltalake, in one script",
                duration(peer_seconds),
                f"{rows / peer_seconds:,.0f}",
                f"{peer_peak / MEGABYTE:.0f}",
                "",
                "not done",
            ),
        ),
        targets=(
            Target(
                what="peak memory of the server", limit=LIMIT, reached=peak / MEGABYTE, unit="MB"
            ),
            Target(
                what="peak memory of the server, long file",
                limit=LIMIT,
                reached=long_peak / MEGABYTE,
                unit="MB",
            ),
        ),
        notes=(
            "A wide file is read in parts, so that its length does not decide the memory; a long "
            "one is sorted apart by tag first, which takes some 40 bytes a row.",
            "The script neither receives nor hashes the file, merges it with nothing that is "
            "stored already, accounts for no row and leaves no audit trail.",
        ),
    )


if __name__ == "__main__":
    begun = time.perf_counter()
    _with_pandas_and_deltalake(Path(sys.argv[1]), Path(sys.argv[2]))
    print(json.dumps({"seconds": time.perf_counter() - begun, "peak": peak_memory()}))
