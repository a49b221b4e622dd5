"""Many loops assessed beside each other, in processes of this machine or of a cluster.

Loops come one after the other and are handed on in chunks, a few at a time, so that a plant of any
size takes the memory of a few chunks. What a worker that dies was doing is done again.
"""

import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from typing import ParamSpec, TypeAlias, TypeVar

from advice.assess import Assessment, assess, not_assessed, not_recorded
from advice.assessment_body import assessment_body
from advice.body import Body
from loop.record import Record
from monitoring.known_loop import KnownLoop
from monitoring.loop_signals import LoopKind
from monitoring.score_profile import DEFAULT_SCORE_PROFILE

Crew: TypeAlias = Callable[[], Executor]
"""Makes an executor; called again when its workers died."""

P = ParamSpec("P")
T = TypeVar("T")

LOOPS_A_CHUNK = 8
SAMPLES_A_CHUNK = 500_000  # after which a chunk is full: a month of seconds goes alone
CHUNKS_IN_FLIGHT = 6  # enough that no worker of a small machine waits for the reader
PATIENCE = 10.0  # s, for a scheduler to answer
MOST_DEATHS = 3  # of workers over one loop, after which it is no longer bad luck
MOST_DEATHS_IN_ALL = 30  # after which it is the machine and not the loops
# Settings that workers start with, unless the user made others.
OF_WORKERS = {
    # One thread a process: the processes are what runs beside each other.
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    # Arrays as long as a record come and go all the time. glibc is not to hand their pages back to
    # the system each time: to get 300 of them again took a twentieth of a loop-day at 10 s.
    "MALLOC_TRIM_THRESHOLD_": str(64 * 2**20),
    "MALLOC_MMAP_THRESHOLD_": str(32 * 2**20),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FleetLoop:
    """One loop of a fleet and what is known of it.

    Attributes
    ----------
    name : str
        What its result is called by.
    record : Record
        Routine data.
    kind : str
        What it controls, see `monitoring.loop_signals.LoopKind`.
    pv_range, op_range : tuple of float
        Lowest and highest PV and OP; the PV range is None where it is not known. [PV], [OP]
    gain_sign : {1, -1} or None
        Sign of the process gain.
    known : KnownLoop or None
        Process model and settings.
    tau_c : float or None
        Desired closed-loop time constant. [s]
    pv_limits : tuple of float or None
        Lowest and highest PV that the process allows. [PV]
    """

    name: str
    record: Record
    kind: str = "other"
    pv_range: tuple[float, float] | None = None
    op_range: tuple[float, float] = (0.0, 100.0)
    gain_sign: int | None = None
    known: KnownLoop | None = None
    tau_c: float | None = None
    pv_limits: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopResult:
    """What the assessment of one loop came to.

    Attributes
    ----------
    name, tag : str
        Name in the fleet, and tag of the loop.
    points : float or None
        Grade, 0 to 100; None where it is not assessable. [-]
    word, cause, confidence, action : str
        Grade and diagnosis in words.
    others : tuple of str
        Further causes that the data show or leave open.
    because : str
        The first piece of evidence.
    body : Body
        The whole assessment as a document.
    """

    name: str
    tag: str
    points: float | None
    word: str
    cause: str
    confidence: str
    action: str
    others: tuple[str, ...]
    because: str
    body: Body


class WorkersKeepDying(RuntimeError):
    """Workers died again and again, whatever they worked on."""

    def __init__(self, deaths: int) -> None:
        super().__init__(
            f"Workers died {deaths} times, whatever they worked on; is the memory enough?"
        )
        self.deaths = deaths


def assess_loop(loop: FleetLoop, profile: str = DEFAULT_SCORE_PROFILE) -> LoopResult:
    """Assess one loop of a fleet; what cannot be assessed is answered with the reason."""
    try:
        assessment = assess(
            loop.record,
            kind=loop.kind,
            pv_range=loop.pv_range,
            op_range=loop.op_range,
            gain_sign=loop.gain_sign,
            known=loop.known,
            tau_c=loop.tau_c,
            pv_limits=loop.pv_limits,
            profile=profile,
        )
    except (ValueError, ArithmeticError) as reason:
        assessment = not_assessed(loop.record, str(reason), kind=loop.kind, profile=profile)
    except Exception as surprise:  # noqa: BLE001 - one loop must not cost the plant its day
        reason_ = f"the assessment failed unexpectedly ({type(surprise).__name__})"
        assessment = not_assessed(loop.record, reason_, kind=loop.kind, profile=profile)
    return _result(loop.name, assessment)


def not_read(tag: str, reason: str, *, kind: LoopKind | str) -> LoopResult:
    """Answer for a loop whose data could not even be read, with the reason."""
    return _result(tag, not_recorded(tag, reason, kind=kind))


def _result(name: str, assessment: Assessment) -> LoopResult:
    diagnosis = assessment.diagnosis
    return LoopResult(
        name=name,
        tag=assessment.tag,
        points=assessment.grade.points,
        word=assessment.grade.word.value,
        cause=diagnosis.cause.value,
        confidence=diagnosis.confidence.value,
        action=diagnosis.action.value,
        others=tuple(other.value for other in diagnosis.others),
        because=diagnosis.evidence[0] if diagnosis.evidence else "",
        body=assessment_body(assessment),
    )


def assess_fleet(
    loops: Iterable[FleetLoop], *, crew: Crew | None = None, profile: str = DEFAULT_SCORE_PROFILE
) -> Generator[LoopResult]:
    """Assess loops as they come and give what came of each, in their order.

    Parameters
    ----------
    loops : iterable of FleetLoop
        Taken a few chunks ahead of what has been given.
    crew : callable, optional
        Makes the executor to work with; by default everything happens in this process.
    profile : str
        Score profile.

    Raises
    ------
    WorkersKeepDying
        One worker after the other dies, whatever it works on.
    """
    if crew is None:
        yield from (assess_loop(loop, profile) for loop in loops)
        return
    source = iter(loops)
    waiting: deque[_Chunk] = deque()
    team = _Team(crew)
    try:
        while True:
            while len(waiting) < CHUNKS_IN_FLIGHT:
                taken = _taken(source)
                if not taken:
                    break
                waiting.append(_Chunk(loops=taken, profile=profile))
            if not waiting:
                return
            try:
                for chunk in waiting:
                    chunk.begin(team.executor)
                found = waiting[0].result()
            except BrokenExecutor:
                team.renew()
                # Nobody can tell whose loop it was: what was under way comes one by one.
                for chunk in waiting:
                    yield from (_alone(loop, profile, team) for loop in chunk.loops)
                waiting.clear()
                continue
            waiting.popleft()
            yield from found
    finally:
        team.dismiss()


def _taken(source: Iterator[FleetLoop]) -> tuple[FleetLoop, ...]:
    """Take loops for one chunk, few if they are long."""
    taken: list[FleetLoop] = []
    samples = 0
    for loop in source:
        taken.append(loop)
        samples += len(loop.record)
        if len(taken) == LOOPS_A_CHUNK or samples >= SAMPLES_A_CHUNK:
            break
    return tuple(taken)


@dataclass(slots=True, kw_only=True, eq=False)
class _Chunk:
    loops: tuple[FleetLoop, ...]
    profile: str
    future: Future[list[LoopResult]] | None = None

    def begin(self, executor: Executor) -> None:
        if self.future is None:
            self.future = executor.submit(_assess_all, self.loops, self.profile)

    def result(self) -> list[LoopResult]:
        assert self.future is not None  # noqa: S101 - it has begun
        return self.future.result()


class _Team:
    """The workers, and new ones in the place of those that died."""

    def __init__(self, crew: Crew) -> None:
        self._crew = crew
        self._deaths = 0
        self.executor = crew()

    def renew(self) -> None:
        self.dismiss()
        self._deaths += 1
        if self._deaths > MOST_DEATHS_IN_ALL:
            raise WorkersKeepDying(self._deaths)
        self.executor = self._crew()

    def dismiss(self) -> None:
        self.executor.shutdown(wait=False, cancel_futures=True)


def _alone(loop: FleetLoop, profile: str, team: _Team) -> LoopResult:
    """Assess a loop with nothing else under way; one that kills its worker is answered so."""
    for _ in range(MOST_DEATHS):
        try:
            return team.executor.submit(_assess_all, (loop,), profile).result()[0]
        except BrokenExecutor:
            team.renew()
    reason = f"whatever worked on it died, {MOST_DEATHS} times; is the memory enough?"
    return _result(loop.name, not_assessed(loop.record, reason, kind=loop.kind, profile=profile))


def _assess_all(loops: tuple[FleetLoop, ...], profile: str) -> list[LoopResult]:
    return [assess_loop(loop, profile) for loop in loops]


def local_crew(processes: int) -> Crew:
    """Work in processes of this machine.

    Parameters
    ----------
    processes : int
        How many.
    """
    # Started anew rather than forked: a service has threads, and a fork of one can hang.
    context = multiprocessing.get_context("spawn")
    for name, value in OF_WORKERS.items():
        os.environ.setdefault(name, value)
    return lambda: ProcessPoolExecutor(processes, mp_context=context)


def cluster_crew(address: str) -> Crew:
    """Work in the workers of a Dask scheduler.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as tcp://10.0.0.7:8786. Its workers need this package.

    Raises
    ------
    ValueError
        The extra `cluster` is not installed; the crew itself raises it when nobody answers.
    """
    if find_spec("distributed") is None:
        raise ValueError("a cluster needs the extra `cluster`: pip install loopwright[cluster]")
    return lambda: _Cluster(address)


class _Cluster(Executor):
    """The workers of a scheduler, and the connection to it for as long as they are needed."""

    def __init__(self, address: str) -> None:
        from distributed import Client

        try:
            self._client = Client(address, timeout=PATIENCE)
        except OSError as error:
            raise ValueError(f"no Dask scheduler answers at {address}") from error
        self._workers = self._client.get_executor()

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Hand work on; what was with a worker that died is given to another by the scheduler."""
        future: Future[T] = self._workers.submit(fn, *args, **kwargs)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Let the workers go; the scheduler drops what nobody waits for."""
        self._workers.shutdown(wait=wait)
        self._client.close()
