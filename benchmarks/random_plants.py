"""Random plants with random data, for judging advice on the plant that it was given for.

The batch P1-P9 is the process batch of Åström and Hägglund's books as it is quoted in public code;
the original lists were not read, and P8 is a member by recollection. P6 integrates.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.margins import margins
from loop.open_loop import process_output
from loop.process import FOPDT, SOPDT, Polynomial, Process, TransferFunction, static_gain
from loop.record import Mode, Record
from loop.signals import Real
from loop.simulation import simulate

# Numerator, denominator and dead time.
Member: TypeAlias = tuple[Polynomial, Polynomial, float]
FAMILIES = ("FOPDT", "SOPDT", "batch")


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A process with the time that it takes: its lags, zeros and dead time together.

    Attributes
    ----------
    family : str
        Where it comes from.
    process : Process
        The process.
    duration : float
        Sum of lags and dead time, less numerator lags: tau + theta of a first-order model. [s]
    """

    family: str
    process: Process
    duration: float


def _lags(*lags: float) -> tuple[float, ...]:
    polynomial: Real = np.ones(1)
    for lag in lags:
        polynomial = np.asarray(np.polymul(polynomial, (lag, 1.0)) if lag else polynomial)
    return tuple(polynomial.tolist())


def batch() -> list[Member]:
    """Numerators, denominators and dead times of the batch that settle by themselves, unit gain."""
    P1 = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200,
          500, 1000)  # fmt: skip
    P2 = (0.01, *P1[:-1])
    P3 = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 2, 5, 10)
    tenths = tuple(k / 10 for k in range(1, 10))
    early = (0.01, 0.02, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
    one: Polynomial = (1.0,)
    members: list[Member] = [(one, _lags(T), 1.0) for T in P1]
    members += [(one, _lags(T, T), 1.0) for T in P2]
    members += [(one, _lags(1.0, T, T), 0.0) for T in P3]
    members += [(one, _lags(*(1.0,) * n), 0.0) for n in (3, 4, 5, 6, 7, 8)]
    members += [(one, _lags(1.0, a, a**2, a**3), 0.0) for a in tenths]
    members += [(one, _lags(T, 1 - L), L) for T in (1.0, 2.0, 5.0, 10.0) for L in early]
    members += [((-a / 10, 1.0), _lags(1.0, 1.0, 1.0), 0.0) for a in range(1, 12)]
    members += [
        (one, tuple(np.polymul((1.0, 1.0), (T * T, 1.4 * T, 1.0)).tolist()), 0.0)
        for T in (*tenths, 1.0)
    ]
    return members


def random_plant(rng: np.random.Generator) -> Plant:
    """Draw a plant: a third each of one lag, two lags, and the batch, any gain and speed."""
    family = FAMILIES[rng.integers(3)]
    K = float(rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(math.log(0.1), math.log(10))))
    speed = float(np.exp(rng.uniform(math.log(5.0), math.log(500.0))))
    if family == "batch":
        members = batch()
        n, d, theta = members[rng.integers(len(members))]
        total = d[-2] + theta - (n[-2] if len(n) > 1 else 0.0)
        scale = speed / total
        powers = scale ** np.arange(len(d) - 1, -1, -1)
        top = scale ** np.arange(len(n) - 1, -1, -1)
        process: Process = TransferFunction(
            tuple((K * np.array(n) * top).tolist()),
            tuple((np.array(d) * powers).tolist()),
            theta * scale,
        )
        return Plant(family=family, process=process, duration=speed)
    theta = speed * float(rng.uniform(0.02, 0.8))
    lag = speed - theta
    if family == "FOPDT":
        process = FOPDT(K=K, tau=lag, theta=theta)
    else:
        part = float(rng.uniform(0.5, 0.95))
        process = SOPDT(K=K, tau1=lag * part, tau2=lag * (1 - part), theta=theta)
    return Plant(family=family, process=process, duration=speed)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataQuality:
    """What is wrong with the data; sizes are parts of the response.

    Attributes
    ----------
    noise : float
        Standard deviation of white noise. [-]
    drift : float
        Change by drift over the record. [-]
    load : float
        Step of the load in the middle, or the wander in automatic. [-]
    resolution : float
        Smallest change that is recorded. [-]
    gaps : float
        Part of the rows that are lost, in three runs. [-]
    density : float
        Samples for each duration of the plant. [-]
    length : float
        Record after the move, in durations of the plant. [-]
    """

    noise: float
    drift: float
    load: float
    resolution: float
    gaps: float
    density: float
    length: float

    @property
    def good(self) -> bool:
        """Whether advice is owed: quiet, long enough, nothing else moved PV."""
        return (
            self.noise <= 0.01
            and self.length >= 5
            and not (self.drift or self.load)
            and self.gaps == 0
            and self.density >= 20
        )


def random_quality(rng: np.random.Generator) -> DataQuality:
    """Draw a quality: a third of the records without drift, load and gaps."""
    clean = rng.random() < 0.35

    def sometimes(chance: float, low: float, high: float) -> float:
        value = float(rng.uniform(low, high))
        return value if rng.random() < chance and not clean else 0.0

    return DataQuality(
        noise=float(np.exp(rng.uniform(math.log(0.002), math.log(0.05)))),
        drift=sometimes(0.35, -0.3, 0.3),
        load=sometimes(0.35, -0.4, 0.4),
        resolution=sometimes(0.4, 0.001, 0.03),
        gaps=sometimes(0.25, 0.01, 0.1),
        density=float(np.exp(rng.uniform(math.log(6.0 if not clean else 20.0), math.log(150.0)))),
        length=float(rng.uniform(2.0, 12.0)),
    )


def _recorded(
    t: Real, sp: Real, pv: Real, op: Real, mode: Mode, quality: DataQuality, size: float,
    rng: np.random.Generator,
) -> Record:  # fmt: skip
    """Quantise and lose rows."""
    step = quality.resolution * size
    pv = np.round(pv / step) * step if step else pv
    kept = np.ones(t.size, dtype=bool)
    if quality.gaps:
        run = max(int(quality.gaps * t.size / 3), 1)
        for first in rng.integers(0, t.size - run, 3).tolist():
            kept[first : first + run] = False
    return Record(
        t=t[kept], sp=sp[kept], pv=pv[kept], op=op[kept],
        mode=np.full(int(np.count_nonzero(kept)), mode, dtype=np.int8),
    )  # fmt: skip


def step_test(plant: Plant, quality: DataQuality, rng: np.random.Generator) -> Record:
    """Record a step in manual, or a step and its return, with everything that is wrong."""
    dt = plant.duration / quality.density
    before = plant.duration * float(rng.uniform(0.5, 2.0))
    after = plant.duration * quality.length
    doublet = rng.random() < 0.4
    t = np.arange(0.0, before + after * (2 if doublet else 1), dt)
    moved = (t >= before).astype(float) - (doublet * (t >= before + after)).astype(float)
    op = 50.0 + 5.0 * moved
    size = 5.0 * abs(static_gain(plant.process))
    load = 5.0 * quality.load * (t >= before + after * float(rng.uniform(0.1, 0.9)))
    pv = process_output(plant.process, t, op + load)
    pv += size * (quality.drift * t / t[-1]) + rng.normal(0.0, quality.noise * size, t.size)
    return _recorded(t, np.full(t.size, 0.0), pv, op, Mode.MAN, quality, size, rng)


def running_settings(plant: Plant, rng: np.random.Generator) -> PID | None:
    """Draw the PI that runs: stable with Ms below 3, from tight to sleepy."""
    action = Action.for_gain(static_gain(plant.process))
    for _ in range(12):
        Kc = float(np.exp(rng.uniform(math.log(0.15), math.log(3.0))))
        pid = PID(
            Kc=Kc / abs(static_gain(plant.process)),
            Ti=plant.duration * float(rng.uniform(0.4, 1.5)),
            action=action,
        )
        try:
            if margins(plant.process, pid).Ms < 3:
                return pid
        except UnstableLoop:
            continue
    return None


def routine_day(
    plant: Plant, quality: DataQuality, pid: PID, rng: np.random.Generator
) -> Record | None:
    """Record automatic operation with none to five set-point moves and wandering loads."""
    dt = plant.duration / quality.density
    n = min(int((4 + 3 * quality.length) * quality.density), 6000)
    t = np.arange(n) * dt
    moves = int(rng.integers(0, 6))
    at = np.sort(rng.integers(n // 12, n - n // 12, moves))
    sp = np.zeros(n)
    for first in at.tolist():
        sp[first:] = float(rng.uniform(-1, 1))
    gain = abs(static_gain(plant.process))
    keep = math.exp(-dt / (plant.duration * float(rng.uniform(0.5, 10.0))))
    wander = np.zeros(n)
    pushes = rng.normal(0.0, abs(quality.load) / gain * math.sqrt(1 - keep**2), n)
    for k in range(1, n):
        wander[k] = keep * wander[k - 1] + pushes[k]
    run = simulate(
        plant.process, pid, t_end=(n - 0.5) * dt, dt=dt, sp=sp, load=wander,
        output_load=quality.drift * t / t[-1], noise=quality.noise, rng=rng,
    )  # fmt: skip
    if not np.all(np.abs(run.pv) < 1e3):
        return None
    return _recorded(t, run.sp, run.pv, run.op, Mode.AUTO, quality, 1.0, rng)
