"""A tuning request through HTTP: from the first byte sent to the last byte of the answer."""

import tempfile
import time
from pathlib import Path
from statistics import median

from benchmarks.section import Section, Target
from benchmarks.server import server
from benchmarks.timing import duration

REQUESTS = 60
WARM_UP = 5
LIMIT = 60.0
PROCESSES: dict[str, dict[str, str | float]] = {
    "FOPDT": {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0},
    "SOPDT": {"kind": "SOPDT", "K": 2.0, "tau1": 120.0, "tau2": 40.0, "theta": 20.0},
    "IPDT": {"kind": "IPDT", "K": 0.01, "theta": 30.0},
}


def run() -> Section:
    """Ask a server again and again, one request after the other, processes in turn."""
    times: dict[str, list[float]] = {name: [] for name in PROCESSES}
    work: dict[str, float] = dict.fromkeys(PROCESSES, 0.0)
    sizes: dict[str, int] = {}
    with (
        tempfile.TemporaryDirectory(prefix="loopwright-bench-") as folder,
        server(Path(folder)) as running,
    ):
        for turn in range(WARM_UP + REQUESTS):
            for name, process in PROCESSES.items():
                # A process of its own each time, so that nothing can be remembered.
                stated = process | {"theta": float(process["theta"]) * (1 + turn / 1_000)}
                start, before = time.perf_counter(), running.processor_time()
                answer = running.client.post("/v1/tunings", json={"process": stated})
                taken = time.perf_counter() - start
                answer.raise_for_status()
                sizes[name] = len(answer.content)
                if turn >= WARM_UP:
                    times[name].append(taken)
                    work[name] += running.processor_time() - before
    rows, targets = [], []
    for name, taken_times in times.items():
        ordered = sorted(taken_times)
        p50, p95 = median(ordered), ordered[int(0.95 * len(ordered))]
        rows.append(
            (
                name,
                duration(p50),
                duration(p95),
                duration(ordered[0]),
                duration(work[name] / REQUESTS),
                f"{sizes[name] / 1e3:.0f}",
            )
        )
        targets.append(Target(what=f"{name}, p50", limit=LIMIT, reached=p50 * 1e3, unit="ms"))
    return Section(
        title="A tuning request through HTTP",
        how=(
            "POST /v1/tunings to a server of one process on this machine, key checked, one request "
            f"after the other over an open connection, {REQUESTS} of each kind; the client's time "
            "to the last byte, and the processor time that the server took for it on average."
        ),
        columns=("process", "p50", "p95", "fastest", "processor time of the server", "answer [kB]"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=("No peer offers this. Client and server share the machine's cores.",),
    )
