"""Times of several ways to do the same work, in turn so that a busy machine hits all alike."""

import gc
import math
import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import TypeAlias

Work: TypeAlias = Callable[[], object]

# A clock reading costs about 0.1 us, and the first call after other work finds the processor's
# caches full of that: a measurement this long makes both small. [s]
SHORTEST_MEASUREMENT = 0.01
# Work shorter than this is called once a round without being timed: it would otherwise pay for
# the data and code of the others in the processor's caches.
WARMED_UP = 0.02
# glibc gives freed memory back to the system until a block about as large as this was freed once;
# from then on it keeps some, as in a process that has worked for a while. Without it, what ran
# before would decide whether a work pays for new pages at every call. [bytes]
LARGE_BLOCK = 30_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Processor time of one call.

    Attributes
    ----------
    median, best : float
        Median and shortest of the repeats. [s]
    repeats : int
        Number of measurements. [-]
    """

    median: float
    best: float
    repeats: int


def processor_time() -> float:
    """Processor time of this process and of the programs it ran. [s]

    All work here runs on one thread, so on an idle machine this is wall time; on a busy one it
    leaves out what other programs took.
    """
    programs = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + programs.ru_utime + programs.ru_stime


def _measure(work: Work, calls: int) -> float:
    start = processor_time()
    for _ in range(calls):
        work()
    return (processor_time() - start) / calls


def interleaved(
    works: Mapping[str, Work], *, repeats: int = 21, seconds: float = 20.0
) -> dict[str, Timing]:
    """Time every work once a round, round after round, warmed up.

    Parameters
    ----------
    works : mapping of str to callable
        Ways to do the same work, by name.
    repeats : int
        Rounds at most; at least three are made. [-]
    seconds : float
        No round is started after this long, by the clock on the wall. [s]

    Returns
    -------
    dict of str to Timing
        One entry a work, in the order given.
    """
    block = bytearray(LARGE_BLOCK)
    del block
    calls, short = {}, set()
    for name, work in works.items():
        work()
        once = _measure(work, 1)
        calls[name] = math.ceil(SHORTEST_MEASUREMENT / max(once, 1e-7))
        if once < WARMED_UP:
            short.add(name)
    taken: dict[str, list[float]] = {name: [] for name in works}
    start = time.perf_counter()
    gc.collect()
    gc.disable()
    try:
        for done in range(repeats):
            if done >= 3 and time.perf_counter() - start > seconds:
                break
            for name, work in works.items():
                if name in short:
                    work()
                taken[name].append(_measure(work, calls[name]))
    finally:
        gc.enable()
    return {
        name: Timing(median=median(times), best=min(times), repeats=len(times))
        for name, times in taken.items()
    }


def duration(seconds: float) -> str:
    """Write a time with three digits and a unit that suits it, `0.00123` as `1.23 ms`."""
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
