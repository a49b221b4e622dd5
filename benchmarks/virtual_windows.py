"""Simulated windows of plant history, hours and days: what a historian keeps of loops as they run.

`benchmarks/virtual_loops.py` draws loops whose valve drives a cycle, sampled as they are scanned.
Plant history is coarser: flow loops answer within one sample, PV and OP are rounded, averaged or
stored by exception, most loops see no set-point move, many hardly move at all, and a sticking
valve rests, lets go and rests again without any regular cycle. Everything follows from a seed;
PV and OP are in percent of their spans.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from benchmarks.random_inputs import for_some, jumps, log_uniform, ramps, wandering, waves
from loop.signals import Flags, Real
from loop.valve import Choudhury, He, Kano, Stem

# Sample time [s], samples a window and scans a sample. Most windows are two hours at 10 s; the
# last two are days, which the service assesses every night.
GRIDS = (
    (10.0, 751, 5),
    (10.0, 751, 3),
    (10.0, 751, 2),
    (10.0, 360, 5),
    (5.0, 1440, 2),
    (60.0, 240, 6),
    (60.0, 126, 5),
    (30.0, 720, 5),
    (2.0, 1500, 1),
    (10.0, 8640, 1),
    (60.0, 1440, 3),
)
# A window longer than this is a day. [s]
DAY = 80_000.0
# A valve's sticking matters where the movement that the stem does not make, put through the
# process, is this part of what OP would make and this many standard deviations of PV's noise.
LOST, SEEN = 0.5, 2.0
# Of the valves that stick, and of the measurements that freeze.
NEVER_MOVES, FROZEN = 1 / 6, 0.02
NEVER = 100.0


class Family(StrEnum):
    """What a loop controls: sets of time constants, disturbances and instruments."""

    FLOW = "flow"
    CASCADE = "flow in a cascade"
    PRESSURE = "pressure"
    LEVEL = "level"
    TEMPERATURE = "temperature"
    ANALYSER = "analyser"


class Truth(StrEnum):
    """What is true of a window."""

    HEALTHY = "healthy"
    SWINGING = "driven from outside or tuned too tight"
    FROZEN = "frozen measurement"
    STICKING = "sticking"
    SLIGHT = "sticking without matter"
    HELD = "sound, held by its own dead band"


# Neither sound nor sticking as far as their loop goes: not fitted, not counted.
NEITHER = (Truth.SLIGHT, Truth.HELD)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Window:
    """One window of one simulated loop.

    Attributes
    ----------
    family : Family
        What it controls.
    truth : Truth
        What is true of it.
    dt : float
        Sample time. [s]
    sp, pv, op : ndarray, shape (n,)
        What the historian kept. [%]
    S, J : float
        Stiction band and slip jump of the valve, S = 100 for one that does not move. [%]
    integrating : bool
        Whether the process integrates.
    """

    family: Family
    truth: Truth
    dt: float
    sp: Real
    pv: Real
    op: Real
    S: float
    J: float
    integrating: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Loops:
    """Parameters of m loops, arrays of shape (m,); times in seconds."""

    K: Real
    tau: Real
    second: Real
    theta: Real
    integrating: Flags
    Kc: Real
    Ti: Real
    hold: Real
    noise: Real
    pv_step: Real
    op_step: Real
    dead_band: Real


# Lag, dead time, and closed-loop time constant asked for, each from-to. [s]
TIMES = {
    Family.FLOW: ((1, 10), (0.5, 5), (5, 300)),
    Family.CASCADE: ((1, 15), (0.5, 5), (5, 60)),
    Family.PRESSURE: ((10, 300), (1, 20), (10, 400)),
    Family.LEVEL: ((2, 20), (2, 30), (30, 1200)),
    Family.TEMPERATURE: ((60, 1500), (10, 200), (60, 1500)),
    Family.ANALYSER: ((120, 2400), (30, 600), (200, 3000)),
}


def _loops(family: Family, m: int, dt: float, tight: Flags, rng: np.random.Generator) -> _Loops:
    """Draw processes, PI controllers from tight to sluggish, and instruments."""
    lags, delays, aims = TIMES[family]
    tau, theta = log_uniform(rng, *lags, m), log_uniform(rng, *delays, m)
    second = tau * rng.uniform(0.0, 0.3, m)
    integrating = np.full(m, family is Family.LEVEL)
    if family is Family.PRESSURE:
        integrating = rng.random(m) < 0.3
    K = log_uniform(rng, 0.3, 6.0, m)
    K = np.where(integrating, log_uniform(rng, 2e-4, 5e-3, m), K)
    hold = for_some(rng, 1.0 if family is Family.ANALYSER else 0.0, log_uniform(rng, 30, 600, m))
    delay = theta + dt + second / 2 + hold
    tau_c = np.maximum(log_uniform(rng, *aims, m), delay)
    tau_c = np.where(tight, delay * rng.uniform(0.15, 0.4, m), tau_c)
    lag = tau + second / 2
    reset = 4 * (tau_c + delay)
    Ti = np.where(integrating, reset, np.minimum(lag, reset))
    Kc = np.where(integrating, 1.0, Ti) / (K * (tau_c + delay))
    # Settings in the field lie off any rule; loops whose gain was raised this way stay calm.
    Kc *= np.exp(rng.uniform(-0.7, 0.2, m))
    Ti *= np.exp(rng.uniform(-0.2, 0.7, m))
    # Many levels are run on little more than proportional action.
    Ti *= np.where(integrating & (rng.random(m) < 0.5), log_uniform(rng, 1.0, 8.0, m), 1.0)
    return _Loops(
        K=K, tau=tau, second=second, theta=theta, integrating=integrating, Kc=Kc, Ti=Ti, hold=hold,
        noise=log_uniform(rng, 0.003, 0.4, m),
        pv_step=for_some(rng, 0.5, log_uniform(rng, 0.003, 0.4, m)),
        op_step=for_some(rng, 0.4, log_uniform(rng, 0.002, 0.1, m)),
        dead_band=for_some(rng, 0.15, log_uniform(rng, 0.02, 0.3, m)),
    )  # fmt: skip


def _load(n: int, dt: float, m: int, outside: Flags, rng: np.random.Generator) -> Real:
    """What disturbs at the valve: wandering, jumps, ramps, and waves for loops driven by them."""
    span = n * dt
    size = log_uniform(rng, 0.01, 2.0, m)
    load = wandering(n, dt, size * rng.uniform(0.1, 1.0, m), log_uniform(rng, 10, span, m), rng)
    load += jumps(n, for_some(rng, 0.25, size), 4, rng)
    load += ramps(n, for_some(rng, 0.25, size), rng)
    wave = np.where(outside, log_uniform(rng, 0.5, 5.0, m), for_some(rng, 0.1, size))
    return load + waves(n, dt, wave, rng)


def _set_point(
    n: int, dt: float, m: int, outside: Flags, family: Family, rng: np.random.Generator
) -> Real:
    """Rests for most loops; steps, ramps, or the output of an outer loop for the others."""
    size = log_uniform(rng, 0.3, 6.0, m)
    if family is Family.CASCADE:
        moving = wandering(n, dt, size / 2, log_uniform(rng, 10, n * dt / 4, m), rng)
        swings = waves(n, dt, np.where(outside, size, 0.0), rng)
        return moving + swings + ramps(n, for_some(rng, 0.3, size), rng)
    steps = jumps(n, for_some(rng, 0.4, size), 5, rng)
    return steps + ramps(n, for_some(rng, 0.1, size), rng)


def _valve(kind: int, S: Real, J: Real, op: Real, position: Real) -> Stem:
    if kind == 0:
        return Choudhury(S=S, J=J).stem(op, position)
    if kind == 1:
        return Kano(S=S, J=J).stem(op, position)
    return He(fs=(S + J) / 2, fd=(S - J) / 2).stem(op, position)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Run:
    """Signals of every scan, shape (n, m); what OP and its unmade part would do to PV."""

    pv: Real
    op: Real
    asked: Real
    lost: Real


def _run(
    loops: _Loops, stem: Stem, sp: Real, load: Real, noise: Real, op0: Real, freezes: Real,
    dt: float,
) -> _Run:  # fmt: skip
    """Run m loops scan by scan about their operating points.

    A measurement shows one value from the scan `freezes` on, shape (m,).
    """
    n, m = sp.shape
    delay = np.maximum(np.rint(loops.theta / dt).astype(int), 0)
    depth = int(delay.max()) + 1
    pipe = np.zeros((depth, m))
    columns = np.arange(m)
    keep1 = np.exp(-dt / loops.tau)
    keep2 = np.where(loops.second > 0, np.exp(-dt / np.maximum(loops.second, 1e-9)), 0.0)
    every = np.maximum(np.rint(loops.hold / dt).astype(int), 1)
    x1, x2, shown, total = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    out, previous = op0.copy(), np.zeros(m)
    fine = np.maximum(loops.pv_step, 1e-9)
    coarse = np.maximum(loops.op_step, 1e-9)
    memory = np.where(loops.integrating, loops.Ti, loops.tau)
    gain = np.where(loops.integrating, loops.K * loops.Ti, loops.K)
    keep = np.exp(-dt / memory)
    pv, op, asked, lost = (np.empty((n, m)) for _ in range(4))
    would, lacks = np.zeros(m), np.zeros(m)
    for k in range(n):
        y = x2 + noise[k]
        y = np.where(loops.pv_step > 0, fine * np.rint(y / fine), y)
        shown = np.where((k % every == 0) & (k < freezes), y, shown)
        error = sp[k] - shown
        total = total + loops.Kc * (error - previous + error * dt / loops.Ti)
        previous = error
        total = np.clip(total, -op0, 100 - op0)
        wanted = op0 + total
        wanted = np.where(loops.op_step > 0, coarse * np.rint(wanted / coarse), wanted)
        out = np.where(np.abs(wanted - out) > loops.dead_band, wanted, out)
        position = stem.step(out)
        pipe[k % depth] = position - op0 + load[k]
        pushed = pipe[(k - delay) % depth, columns]
        x1 = np.where(
            loops.integrating, x1 + loops.K * dt * pushed,
            keep1 * x1 + (1 - keep1) * loops.K * pushed,
        )  # fmt: skip
        x2 = keep2 * x2 + (1 - keep2) * x1
        would = keep * would + (1 - keep) * gain * (out - op0)
        lacks = keep * lacks + (1 - keep) * gain * (out - position)
        pv[k], op[k], asked[k], lost[k] = shown, out, would, lacks
    return _Run(pv=pv, op=op, asked=asked, lost=lost)


def _stored(signal: Real, kind: int, size: float) -> Real:
    """What a historian gives back: as it is, held or straight between values beyond `size`."""
    if kind == 0:
        return signal
    kept = [0]
    for k in range(1, signal.size):
        if abs(signal[k] - signal[kept[-1]]) > size:
            kept.append(k)
    places = np.array(kept)
    grid = np.arange(signal.size)
    if kind == 1:
        return np.asarray(signal[places[np.searchsorted(places, grid, side="right") - 1]])
    return np.asarray(np.interp(grid, places, signal[places]))


def windows(
    family: Family,
    count: int,
    *,
    sticking: bool,
    seed: int,
    grids: Sequence[tuple[float, int, int]] = GRIDS,
) -> Iterator[Window]:
    """Simulate windows of one family, healthy and others, or with a valve that sticks.

    Parameters
    ----------
    family : Family
        What the loops control.
    count : int
        How many are drawn; those that saturate, diverge or do not move at all are left out.
    sticking : bool
        Whether the valves stick.
    seed : int
        Seed of everything.
    grids : sequence of tuple
        Sample time [s], samples a window and scans a sample; the windows are spread over them.
    """
    rng = np.random.default_rng([seed, list(Family).index(family), int(sticking)])
    for part, (sample, n, scans) in enumerate(grids):
        # The same grids for sound and sticking valves: the sample time must not tell them apart.
        m = count // len(grids) + (part < count % len(grids))
        if m:
            yield from _batch(family, m, sample, n, scans, (part + seed) % 3, sticking, rng)


def _batch(
    family: Family, m: int, sample: float, n: int, scans: int, kind: int, sticking: bool,
    rng: np.random.Generator,
) -> Iterator[Window]:  # fmt: skip
    dt = sample / scans
    before = n // 4
    length = (n + before) * scans
    driven = rng.random(m) < 0.2
    tight = driven & (rng.random(m) < 0.4) & (not sticking)
    outside = driven & ~tight
    loops = _loops(family, m, dt, tight, rng)
    op0 = rng.uniform(8, 92, m)
    S, J = _friction(m, sticking, rng)
    freezes = np.full(m, np.inf)
    frozen = (rng.random(m) < FROZEN) & (not sticking)
    freezes[frozen] = length * rng.uniform(0.25, 0.7, int(frozen.sum()))
    stem = _valve(kind, S, J, op0, op0 + rng.uniform(-0.4, 0.4, m) * np.minimum(S, 20))
    own = np.where(loops.integrating, 0.0, log_uniform(rng, 0.01, 1.0, m))
    drift = wandering(length, dt, own, log_uniform(rng, 5, 3000, m), rng)
    white = rng.normal(size=(length, m)) * loops.noise
    load = _load(length, dt, m, outside, rng)
    sp = _set_point(length, dt, m, outside, family, rng)
    run = _run(loops, stem, sp, load, white + drift, op0, freezes, dt)
    for j in range(m):
        found = _window(run, loops, sp, j, before * scans, scans, rng)
        if found is None:
            continue
        pv, op, set_point = found
        truth = Truth.SWINGING if driven[j] else Truth.HEALTHY
        matters = _matters(run, loops, j, before * scans)
        if frozen[j]:
            truth = Truth.FROZEN
        elif sticking:
            truth = Truth.STICKING if matters else Truth.SLIGHT
        elif matters:
            truth = Truth.HELD
        yield Window(
            family=family, truth=truth, dt=sample, sp=set_point, pv=pv, op=op,
            S=float(S[j]), J=float(J[j]), integrating=bool(loops.integrating[j]),
        )  # fmt: skip


def _friction(m: int, sticking: bool, rng: np.random.Generator) -> tuple[Real, Real]:
    """S and J: a sound valve has up to a quarter percent; one sticking valve in six never moves."""
    if not sticking:
        S = for_some(rng, 0.5, rng.uniform(0.0, 0.25, m))
        return S, S * rng.uniform(0.0, 1.0, m)
    S = log_uniform(rng, 0.4, 12.0, m)
    J = S * np.where(rng.random(m) < 0.25, 0.0, rng.uniform(0.0, 1.0, m))
    stuck = rng.random(m) < NEVER_MOVES
    return np.where(stuck, NEVER, S), np.where(stuck, NEVER / 2, J)


def _window(
    run: _Run, loops: _Loops, sp: Real, j: int, first: int, scans: int, rng: np.random.Generator
) -> tuple[Real, Real, Real] | None:
    """The historian's samples of one loop; None where it saturates, diverges or does not move."""
    op, pv = run.op[first:, j], run.pv[first:, j]
    if not np.all(np.isfinite(pv)) or np.ptp(pv) > 60 or op.min() < 1 or op.max() > 99:
        return None
    if np.ptp(op) < 0.01 or np.ptp(pv) == 0:
        return None
    mean = rng.random() < 0.5
    signals = []
    for signal in (pv, op, sp[first:, j]):
        blocks = signal.reshape(-1, scans)
        signals.append(blocks.mean(axis=1) if mean else blocks[:, -1].copy())
    kind = int(rng.choice([0, 0, 0, 0, 0, 0, 0, 1, 2]))
    pv = _stored(signals[0], kind, loops.noise[j] * rng.uniform(0.2, 3.0))
    op = signals[1]
    if rng.random() < 0.08:
        held = _stale(pv.size, rng)
        pv, op = pv[held], op[held]
    return pv, op, signals[2]


def _stale(n: int, rng: np.random.Generator) -> np.ndarray:
    """Rows that a collector repeats while it gets no new ones."""
    rows = np.arange(n)
    for _ in range(rng.integers(1, 30)):
        first = int(rng.integers(0, n))
        rows[first : first + int(rng.integers(2, n // 15))] = rows[first]
    return rows


def _matters(run: _Run, loops: _Loops, j: int, first: int) -> bool:
    """Whether the movement that the stem does not make would be seen in PV."""
    lost, asked = float(np.std(run.lost[first:, j])), float(np.std(run.asked[first:, j]))
    return lost >= LOST * asked and lost >= SEEN * float(loops.noise[j])
