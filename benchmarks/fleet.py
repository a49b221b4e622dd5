"""A plant's day assessed out of the sample store: every loop, two processes, time and memory.

    python -m benchmarks.fleet --loops 5000

The same run with fewer loops is part of `python -m benchmarks`.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from itertools import cycle, islice
from pathlib import Path
from uuid import UUID

import numpy as np
import pyarrow as pa

from benchmarks.section import Section, Target
from benchmarks.timing import duration, processor_time
from benchmarks.virtual_loops import State, VirtualLoop, virtual_loops
from historian.sample_layout import BUCKETS, bucket_of, tables_of, write_file
from historian.sample_log import SampleLog
from historian.sample_rows import rows_of
from historian.sample_tidy import ROWS_A_FILE
from historian.samples import Samples
from service.cli.installation import KEY, writing
from service.database import Database
from service.keys.actions import actor_with_token
from service.loops.actions import create_loop
from service.loops.schemas import NewLoop
from service.samples import open_samples
from service.settings import Settings

FEW_LOOPS, LOOPS, ALL_LOOPS = 40, 400, 5000
SAMPLES, SAMPLE_TIME = 8640, 10
DAY = date(2026, 3, 2)
SEED = 5
# Fifty distinct loops, in the shares of a plant that has its troubles.
SHARES = {
    State.HEALTHY: 30, State.OUTSIDE: 8, State.SET_POINT: 2, State.TIGHT: 5, State.STICKING: 5,
}  # fmt: skip
PROCESSES = 2
SECONDS, MEMORY = 180.0, 2000.0
LOOK_EVERY = 0.2


@dataclass(slots=True)
class Watch:
    """Largest memory of a process and all below it, each shared page counted once.

    Attributes
    ----------
    pid : int
        The process.
    peak : float
        Largest sum of proportional set sizes so far; resident sizes where the system tells no
        others. [bytes]
    """

    pid: int
    peak: float = 0.0
    _ended: threading.Event = field(default_factory=threading.Event)

    def watch(self) -> None:
        """Look again and again until told to stop."""
        while not self._ended.wait(LOOK_EVERY):
            self.peak = max(self.peak, sum(_memory(pid) for pid in _family(self.pid)))

    def stop(self) -> None:
        """End watching."""
        self._ended.set()


def _family(pid: int) -> Iterator[int]:
    yield pid
    try:
        below = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    except OSError:
        return
    for child in below:
        yield from _family(int(child))


def _memory(pid: int) -> float:
    for name, key in (("smaps_rollup", "Pss:"), ("status", "VmRSS:")):
        try:
            text = Path(f"/proc/{pid}/{name}").read_text(encoding="ascii")
        except OSError:
            continue
        for line in text.splitlines():
            if line.startswith(key):
                return float(line.split()[1]) * 1024
    return 0.0


def plant(count: int) -> Iterator[VirtualLoop]:
    """Simulate fifty loops and give them again and again, shuffled."""
    distinct = [
        one
        for state, share in SHARES.items()
        for one in virtual_loops(state, share, samples=SAMPLES, seed=SEED)
    ]
    order = np.random.default_rng(SEED).permutation(len(distinct))
    return islice(cycle([distinct[k] for k in order]), count)


def varied(one: VirtualLoop, rng: np.random.Generator) -> Samples:
    """Make another loop of a simulated one: other gains, other noise, three decimals.

    No two loops of the plant are equal, and a valve that sticks goes on sticking.
    """
    size = float(np.exp(rng.uniform(np.log(0.3), np.log(1.5))))
    noise = 0.02 * float(np.std(one.pv)) * rng.normal(size=one.pv.size)
    pv, sp = (50 + size * (signal - 50) for signal in (one.pv + noise, one.sp))
    first = np.datetime64(DAY, "us")
    return Samples(
        time=first + np.arange(one.pv.size) * np.timedelta64(SAMPLE_TIME, "s"),
        pv=np.round(pv, 3),
        sp=np.round(sp, 3),
        op=np.round(one.op, 3),
        mode=np.full(one.pv.size, 1, np.int8),
    )


def build(folder: Path, count: int) -> str:
    """Make an installation with so many loops and a day of samples of each.

    Returns
    -------
    str
        Key of an engineer.
    """
    _loopwright(folder, "migrate")
    token = _loopwright(folder, "key", "create", "--owner", "bench", "--role", "engineer").strip()
    settings = Settings(data=folder)
    held = Database.at(settings.url)
    with held.readings() as session:
        actor = actor_with_token(session, token)
    with writing(held) as session:
        names = [create_loop(session, actor=actor, loop=_described(k)).id for k in range(count)]
    held.engine.dispose()
    _store(settings, {str(name): one for name, one in zip(names, plant(count), strict=True)})
    return token


def _store(settings: Settings, loops: Mapping[str, VirtualLoop]) -> None:
    """Lay a day of every loop down as `tidy` leaves it: few files, each a range of loops.

    One upload a loop and tidying them would give the same files, in a quarter of an hour.
    """
    folder = settings.data / "samples"
    open_samples(settings)
    log = SampleLog(folder)
    for bucket in range(BUCKETS):
        names = sorted(name for name in loops if bucket_of(name) == bucket)
        most = ROWS_A_FILE // SAMPLES
        for part in (names[k : k + most] for k in range(0, len(names), most)):
            log.commit([write_file(folder, DAY, bucket, _tables(part, loops))], [])


def _tables(names: Iterable[str], loops: Mapping[str, VirtualLoop]) -> Iterator[pa.Table]:
    for name in names:
        rng = np.random.default_rng([SEED, int(UUID(name)) % 2**32])
        yield from tables_of(name, rows_of(varied(loops[name], rng)))


def _described(k: int) -> NewLoop:
    return NewLoop(
        tag=f"FIC-{k:05}", pv_low=0.0, pv_high=100.0, pv_unit="%", action="reverse", form="isa",
        time_unit="s", gain_basis="percent", kind="flow", area=f"A{k % 20}",
    )  # fmt: skip


def _loopwright(folder: Path, *words: str) -> str:
    command = [str(Path(sys.executable).with_name("loopwright")), *words, "--data", str(folder)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one assessment of the plant took.

    Attributes
    ----------
    loops : int
        Loops assessed.
    seconds, processor : float
        Time by the clock on the wall and of the processors. [s]
    peak : float
        Largest memory of all processes together. [bytes]
    read : float
        Time to read the samples of all loops, alone. [s]
    built : float
        Time it took to simulate and to store the day. [s]
    load : float
        Mean number of processes that wanted a processor over the minute before. [-]
    causes : str
        What was found.
    """

    loops: int
    seconds: float
    processor: float
    peak: float
    read: float
    built: float
    load: float
    causes: str


def assessed(count: int) -> Run:
    """Build a plant, assess its day as a person would by hand, and watch."""
    with tempfile.TemporaryDirectory(prefix="loopwright-fleet-") as place:
        folder = Path(place)
        start = time.perf_counter()
        token = build(folder, count)
        built = time.perf_counter() - start
        load = os.getloadavg()[0]
        command = [
            str(Path(sys.executable).with_name("loopwright")), "assess", "--day", f"{DAY}",
            "--processes", str(PROCESSES), "--data", place,
        ]  # fmt: skip
        before, start = processor_time(), time.perf_counter()
        with (folder / "answer.txt").open("w") as answer:
            process = subprocess.Popen(
                command, stdout=answer, stderr=subprocess.DEVNULL, env={**os.environ, KEY: token}
            )
            watch = Watch(process.pid)
            watching = threading.Thread(target=watch.watch)
            watching.start()
            code = process.wait()
            seconds = time.perf_counter() - start
            watch.stop()
            watching.join()
        assert code == 0, f"loopwright assess ended with {code}"
        processor = processor_time() - before
        *_, loops, causes = (folder / "answer.txt").read_text("utf-8").splitlines()
        assert loops.startswith(f"Loops: {count},"), loops
        start = time.perf_counter()
        samples = open_samples(Settings(data=folder))
        read = sum(len(found) for _, found in samples.read_day(DAY))
        assert read == count * SAMPLES
        reading = time.perf_counter() - start
    return Run(
        loops=count, seconds=seconds, processor=processor, peak=watch.peak, read=reading,
        built=built, load=load, causes=f"{loops.partition(', ')[2]}; {causes.partition(': ')[2]}",
    )  # fmt: skip


def run() -> Section:
    """Assess as many loops as a look at all benchmarks bears."""
    return measure(LOOPS)


def measure(count: int) -> Section:
    """Assess so many loops; what all would take follows from a run with few of them beside it."""
    found = assessed(count)
    seconds, processor = found.seconds, found.processor
    if count < ALL_LOOPS:
        few = assessed(FEW_LOOPS)
        more = (ALL_LOOPS - count) / (count - FEW_LOOPS)
        seconds += more * (found.seconds - few.seconds)
        processor += more * (found.processor - few.processor)
    return Section(
        title="A plant's day out of the sample store",
        how=(
            f"`loopwright assess --day` over an installation of {count:,} loops with "
            f"{SAMPLES:,} samples each (a day at {SAMPLE_TIME} s), {PROCESSES} processes, from the "
            "start of the command to the printed scorecard: samples read from the store, every "
            "index, diagnosis and grade, results stored in the database. "
            f"{sum(SHARES.values())} simulated loops varied in size and noise, of which "
            + ", ".join(f"{share} {state.value}" for state, share in SHARES.items())
            + f". Load of the machine before the start {found.load:.1f} on "
            f"{os.cpu_count()} cores."
        ),
        columns=("what", "value"),
        rows=(
            ("loops", f"{count:,}"),
            ("time", duration(found.seconds)),
            ("processor time", duration(found.processor)),
            ("processor time a loop", duration(found.processor / count)),
            ("peak memory of all processes", f"{found.peak / 1e6:.0f} MB"),
            ("to read the samples alone", duration(found.read)),
            ("to simulate and store them", duration(found.built)),
            ("found", found.causes),
        ),
        targets=(
            Target(what=f"time for {ALL_LOOPS:,} loops", limit=SECONDS, unit="s", reached=seconds),
            Target(what=f"processor time for {ALL_LOOPS:,} loops over {PROCESSES} cores",
                   limit=SECONDS, unit="s", reached=processor / PROCESSES),
            Target(what="peak memory of all processes", limit=MEMORY, unit="MB",
                   reached=found.peak / 1e6),
        ),
        notes=(
            (
                f"The times of {ALL_LOOPS:,} loops follow from this run and one of {FEW_LOOPS}, so "
                "that the start of the processes counts once. All of them: `python -m "
                f"benchmarks.fleet --loops {ALL_LOOPS}`. "
                if count < ALL_LOOPS
                else ""
            )
            + "The time by the clock counts what other programs on the machine take; the processor "
            "time does not. Memory shared by processes counts once.",
        ),
    )  # fmt: skip


if __name__ == "__main__":
    from benchmarks.section import as_markdown

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=LOOPS)
    print(f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC")
    print(as_markdown(measure(parser.parse_args().loops)))
