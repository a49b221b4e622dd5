"""Simulated plants in which one loop, or something outside, makes several loops swing.

Everything follows from a seed. Time is in samples of one second; PV and OP are in percent.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum

import numpy as np
from scipy.signal import lfilter

from loop.controller import PID
from loop.errors import LoopDiverged
from loop.experiment import Experiment
from loop.interacting import simulate_cascade, simulate_interacting
from loop.open_loop import process_output
from loop.process import FOPDT, IPDT, SOPDT, Process
from loop.record import Record
from loop.signals import Real
from loop.simulation import Response, simulate
from loop.valve import Choudhury, He, Kano, Valve

LOOPS = 4
# Loops' own processes, and how many of a hundred are of each kind.
KINDS, PARTS = ("one lag", "two lags", "integrator"), (0.4, 0.3, 0.3)
SAMPLES = 4000
SETTLED = 600
START = datetime(2026, 1, 31, tzinfo=UTC)


class Topology(StrEnum):
    """How the loops hang together."""

    CHAIN = "chain"
    RECYCLE = "chain with a recycle"
    UTILITY = "one utility for all"
    CASCADE = "cascade with loops behind it"


class Origin(StrEnum):
    """What makes the loops swing."""

    VALVE = "sticking valve"
    TIGHT = "a loop tuned too tight"
    ENTERS = "from outside, into one loop"
    COMMON = "from outside, into all loops"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SharedSwing:
    """One simulated plant.

    Attributes
    ----------
    topology : Topology
        How the loops hang together.
    origin : Origin
        What makes them swing.
    source : int or None
        Place of the loop where it begins or enters; None where it enters everywhere.
    records : tuple of Record
        The loops, called by letters.
    """

    topology: Topology
    origin: Origin
    source: int | None
    records: tuple[Record, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Loop:
    """A process with its controller; lag and delay as the tuning took them. [s]"""

    process: FOPDT | SOPDT | IPDT
    pid: PID
    lag: float
    delay: float


def shared_swings(
    topology: Topology, origin: Origin, count: int, *, seed: int
) -> Iterator[SharedSwing]:
    """Simulate plants whose loops swing.

    Parameters
    ----------
    topology : Topology
        How their loops hang together.
    origin : Origin
        What makes them swing.
    count : int
        How many.
    seed : int
        Seed of everything.
    """
    rng = np.random.default_rng([seed, list(Topology).index(topology), list(Origin).index(origin)])
    made = 0
    while made < count:
        try:
            plant = _plant(topology, origin, rng)
        except LoopDiverged:
            continue
        made += 1
        yield plant


def _plant(topology: Topology, origin: Origin, rng: np.random.Generator) -> SharedSwing:
    # The last loop of a chain moves no other; where it begins there is nothing to rank.
    source = int(rng.integers(0, 1 if topology is Topology.UTILITY else LOOPS - 1))
    if topology is Topology.CASCADE:
        source = 1  # the inner loop has the valve
    loops = [_loop(rng, tight=origin is Origin.TIGHT and k == source) for k in range(LOOPS)]
    valve = _valve(rng) if origin is Origin.VALVE else None
    waves = _waves(origin, source, rng)
    loads = [_drift(rng, 0.15) for _ in range(LOOPS)]
    noise = [rng.normal(size=SAMPLES) * rng.uniform(0.02, 0.2) for _ in range(LOOPS)]
    rest = [
        Experiment(
            t_end=SAMPLES - 1.0, dt=1.0, pv0=50.0, op0=50.0, load=loads[k], noise=noise[k],
            output_load=waves[k], valve=valve if k == source else None,
        )
        for k in range(LOOPS)
    ]  # fmt: skip
    runs: Sequence[Response]
    if topology is Topology.CASCADE:
        runs = _cascade(loops, rest, waves, rng)
    else:
        runs = simulate_interacting(
            _couplings(topology, loops, rng), [one.pid for one in loops], rest
        )
    return SharedSwing(
        topology=topology, origin=origin,
        source=None if origin is Origin.COMMON else source,
        records=tuple(_record(run, tag) for run, tag in zip(runs, "ABCD", strict=True)),
    )  # fmt: skip


def _loop(rng: np.random.Generator, *, tight: bool = False) -> _Loop:
    """Make a loop with a PI by SIMC, from usual to slow, or far too tight.

    A valve's square wave comes out of one lag with corners, out of two or of an integrator rounded.
    """
    theta = float(np.exp(rng.uniform(np.log(1.5), np.log(8.0))))
    tau = theta * float(np.exp(rng.uniform(np.log(1.0), np.log(6.0))))
    K = rng.uniform(0.6, 1.6)
    second = tau * rng.uniform(0.2, 1.0)
    kind = "one lag" if tight else rng.choice(KINDS, p=PARTS)
    process: FOPDT | SOPDT | IPDT = FOPDT(K=K, tau=tau, theta=theta)
    delay, lag = theta + 0.5, tau
    if kind == "two lags":
        process = SOPDT(K=K, tau1=tau, tau2=second, theta=theta)
        delay, lag = delay + second / 2, tau + second / 2
    elif kind == "integrator":
        process = IPDT(K=K / tau, theta=theta)
    tau_c = theta * (rng.uniform(-0.36, -0.3) if tight else np.exp(rng.uniform(0.0, np.log(4.0))))
    reset = 4 * (tau_c + delay)
    Ti = reset if kind == "integrator" else min(lag, reset)
    return _Loop(process=process, pid=PID(Kc=lag / (K * (tau_c + delay)), Ti=Ti), lag=lag,
                 delay=delay)  # fmt: skip


def _valve(rng: np.random.Generator) -> Valve:
    S = float(np.exp(rng.uniform(np.log(2.0), np.log(8.0))))
    J = S * rng.uniform(0.3, 1.0)
    kinds = (Choudhury(S=S, J=J), Kano(S=S, J=J), He(fs=(S + J) / 2, fd=(S - J) / 2))
    return kinds[int(rng.integers(3))]


def _waves(origin: Origin, source: int, rng: np.random.Generator) -> list[Real]:
    """What comes from outside into every loop."""
    waves: list[Real] = [np.zeros(SAMPLES) for _ in range(LOOPS)]
    if origin is Origin.ENTERS:
        waves[source] = _wave(rng)
    if origin is Origin.COMMON:
        wave = _wave(rng)
        ways = [_between(rng) for _ in range(LOOPS)]
        t = np.arange(SAMPLES, dtype=np.float64)
        waves = [process_output(way, t, wave - wave[0], op_before=0.0) for way in ways]
    return waves


def _wave(rng: np.random.Generator) -> Real:
    """Make a swing that wanders in size and phase, as what other units send does."""
    period = float(np.exp(rng.uniform(np.log(25.0), np.log(120.0))))
    w, r = 2 * np.pi / period, np.exp(-1 / (period * rng.uniform(5.0, 40.0)))
    swing = lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], rng.normal(size=2 * SAMPLES))
    swing = swing[SAMPLES:]
    return np.asarray(swing / np.std(swing) * rng.uniform(0.7, 2.5))


def _drift(rng: np.random.Generator, size: float) -> Real:
    memory = np.exp(-1 / rng.uniform(20.0, 200.0))
    return size * np.asarray(
        lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], rng.normal(size=SAMPLES))
    )


def _between(rng: np.random.Generator) -> FOPDT:
    """Make what lies between two loops."""
    return FOPDT(
        K=rng.uniform(0.3, 1.0) * rng.choice([-1.0, 1.0]),
        tau=float(np.exp(rng.uniform(np.log(3.0), np.log(30.0)))),
        theta=float(np.exp(rng.uniform(np.log(2.0), np.log(20.0)))),
    )


def _couplings(
    topology: Topology, loops: list[_Loop], rng: np.random.Generator
) -> list[list[Process | None]]:
    processes: list[list[Process | None]] = [[None] * LOOPS for _ in range(LOOPS)]
    for k in range(LOOPS):
        processes[k][k] = loops[k].process
        if k:
            processes[k][0 if topology is Topology.UTILITY else k - 1] = _between(rng)
    if topology is Topology.RECYCLE:
        back = _between(rng)
        processes[0][LOOPS - 1] = FOPDT(K=0.3 * back.K, tau=back.tau, theta=back.theta)
    return processes


def _cascade(
    loops: list[_Loop],
    rest: list[Experiment],
    waves: list[Real],
    rng: np.random.Generator,
) -> list[Response]:
    """Run an outer loop A over an inner loop B whose flow also moves C, which moves D."""
    inner, outer = loops[1], _loop(rng)
    slow = FOPDT(
        K=rng.uniform(0.6, 1.6), tau=5 * outer.lag + 5 * inner.lag,
        theta=2 * outer.delay + inner.delay,
    )  # fmt: skip
    closed = 2 * inner.delay  # the inner loop takes about so long to follow
    Ti = min(slow.tau, 8 * (slow.theta + closed))
    outer_pid = PID(Kc=slow.tau / (slow.K * 3 * (slow.theta + closed)), Ti=Ti)
    run = simulate_cascade(slow, inner.process, outer_pid, inner.pid, outer=rest[0], inner=rest[1])
    runs = [run.outer, run.inner]
    for k in (2, 3):
        moved = runs[-1].position if k == 2 else runs[-1].op
        wave = process_output(_between(rng), runs[-1].t, moved - moved[0], op_before=0.0)
        item = rest[k]
        runs.append(
            simulate(
                loops[k].process, loops[k].pid, t_end=item.t_end, dt=1.0, pv0=50.0, op0=50.0,
                load=item.load, noise=item.noise, output_load=wave + waves[k],
            )
        )  # fmt: skip
    return runs


def _record(run: Response, tag: str) -> Record:
    keep = slice(SETTLED, None)
    return Record(
        t=run.t[keep] - run.t[SETTLED], pv=run.pv[keep], sp=run.sp[keep], op=run.op[keep],
        start=START, tag=tag, pv_unit="%", op_unit="%",
    )  # fmt: skip
