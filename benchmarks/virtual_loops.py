"""Simulated loops with a known state: healthy, driven from outside, too tight, or sticking.

Everything follows from a seed. Time is in samples of one second; PV and OP are in percent.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.signal import lfilter

from loop.controller import PID
from loop.process import FOPDT, IPDT
from loop.signals import Real
from loop.simulation_batch import simulate_batch
from loop.valve import Choudhury, He, Kano, Valve

AR_COEFFICIENTS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.97)
# A valve drives a cycle where, without noise, PV keeps moving by this part of what a slip moves it,
# six times at least in the record and with eight samples a cycle at least.
DRIVEN = 0.2


class State(StrEnum):
    """What is true of a simulated loop."""

    HEALTHY = "healthy"
    OUTSIDE = "driven from outside"
    SET_POINT = "driven by its set point"
    TIGHT = "tuned too tight"
    STICKING = "sticking"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualLoop:
    """One simulated loop.

    Attributes
    ----------
    state : State
        What is true of it.
    sp, pv, op : ndarray, shape (n,)
        Signals, one sample a second. [%]
    process : FOPDT or IPDT
        The true process.
    controller : PID
        Its controller.
    S, J : float
        Stiction band and slip jump, 0 for a healthy valve. [%]
    drives : bool
        The valve alone, without noise, keeps a cycle up.
    phi : float
        Autocorrelation of the disturbance at the output, whose variance is one, from sample to
        sample. [-]
    noise : float
        Sd of the noise of the measurement, 0 where it is not told. [%]
    """

    state: State
    sp: Real
    pv: Real
    op: Real
    process: FOPDT | IPDT
    controller: PID
    S: float = 0.0
    J: float = 0.0
    drives: bool = False
    phi: float = 0.0
    noise: float = 0.0

    @property
    def integrating(self) -> bool:
        """Whether the process integrates."""
        return isinstance(self.process, IPDT)


def virtual_loops(state: State, count: int, *, samples: int, seed: int) -> Iterator[VirtualLoop]:
    """Simulate loops of one state.

    Parameters
    ----------
    state : State
        What shall be true of them.
    count : int
        How many.
    samples : int
        Length of every record.
    seed : int
        Seed of everything.
    """
    rng = np.random.default_rng([seed, samples, list(State).index(state)])
    loops = [_loop(rng, tight=state is State.TIGHT) for _ in range(count)]
    if state is State.STICKING:
        yield from _sticking(loops, samples, rng)
        return
    phi = rng.choice(AR_COEFFICIENTS, count)
    sp, load, output = _healthy_inputs(samples, phi, rng)
    noise = rng.normal(size=(samples, count))
    sd = rng.uniform(0.05, 0.5, count)
    if state is State.OUTSIDE:
        output += _waves(samples, count, rng)
    elif state is State.SET_POINT:
        sp += _waves(samples, count, rng)
    elif state is State.TIGHT:
        sp[:] = 0.0
    run = simulate_batch(
        [p for p, _ in loops], [c for _, c in loops], t_end=samples - 1.0, dt=1.0,
        sp=sp + 50, load=load, output_load=output, noise=noise * sd, pv0=50.0, op0=50.0,
    )  # fmt: skip
    for k, (process, controller) in enumerate(loops):
        if not run.diverged[k]:
            yield VirtualLoop(
                state=state, sp=_column(run.sp, k), pv=run.pv[:, k], op=run.op[:, k],
                process=process, controller=controller, phi=float(phi[k]), noise=float(sd[k]),
            )  # fmt: skip


def _column(signal: Real, k: int) -> Real:
    return signal if signal.ndim == 1 else signal[:, k]


def _loop(rng: np.random.Generator, *, tight: bool) -> tuple[FOPDT | IPDT, PID]:
    """A process with dead time and a PI by SIMC, from tight to slow.

    A hold adds half a sample of dead time, which the rule is told of.
    """
    theta = float(np.exp(rng.uniform(np.log(0.4), np.log(10))))
    slow = float(np.exp(rng.uniform(0.0, np.log(6.0))))
    tau_c = theta * (rng.uniform(0.25, 0.45) if tight else slow)
    if rng.random() < 0.3:
        process = IPDT(K=float(np.exp(rng.uniform(np.log(0.003), np.log(0.05)))), theta=theta)
        tau_c = max(tau_c, 1.5 * theta) if not tight else tau_c
        Kc = 1 / (process.K * (tau_c + theta + 0.5))
        return process, PID(Kc=Kc, Ti=rng.uniform(0.7, 1.5) * 4 * (tau_c + theta + 0.5))
    tau = theta * float(np.exp(rng.uniform(np.log(0.3), np.log(10))))
    first = FOPDT(K=rng.uniform(0.5, 2.0), tau=tau, theta=theta)
    Ti = rng.uniform(0.7, 1.5) * min(tau, 4 * (tau_c + theta + 0.5))
    Kc = Ti / (first.K * (tau_c + theta + 0.5))
    return first, PID(Kc=Kc, Ti=Ti)


def _healthy_inputs(n: int, phi: Real, rng: np.random.Generator) -> tuple[Real, Real, Real]:
    """Set-point moves, loads and noise of unit variance at the output, autocorrelated by phi."""
    m = phi.size
    white = rng.normal(size=(n, m))
    output = np.stack(
        [lfilter([np.sqrt(1 - phi[j] ** 2)], [1.0, -phi[j]], white[:, j]) for j in range(m)],
        axis=1,
    )
    return _moves(n, m, rng), _moves(n, m, rng), output


def _moves(n: int, m: int, rng: np.random.Generator) -> Real:
    """For half of the loops, up to seven jumps at random instants."""
    level = np.zeros((n, m))
    for j in range(m):
        if rng.random() < 0.5:
            for _ in range(rng.integers(1, 8)):
                level[rng.integers(10, n) :, j] += 3 * rng.normal()
    return level


def _waves(n: int, m: int, rng: np.random.Generator) -> Real:
    """Sines, and some triangles and squares rounded by a lag, as other loops send them."""
    t = np.arange(n)
    waves = np.empty((n, m))
    for j in range(m):
        period = float(np.exp(rng.uniform(np.log(10), np.log(n / 10))))
        angle = 2 * np.pi * t / period + rng.uniform(0, 2 * np.pi)
        shape = rng.random()
        if shape < 0.6:
            wave = np.sin(angle)
        else:
            wave = np.sign(np.sin(angle)) if shape < 0.8 else 2 / np.pi * np.arcsin(np.sin(angle))
            keep = np.exp(-1 / (period * rng.uniform(0.1, 0.5)))
            wave = lfilter([1 - keep], [1.0, -keep], wave)
            wave /= np.std(wave) * np.sqrt(2)
        waves[:, j] = rng.uniform(1.0, 6.0) * wave
    return waves


def _sticking(
    loops: list[tuple[FOPDT | IPDT, PID]], n: int, rng: np.random.Generator
) -> Iterator[VirtualLoop]:
    m = len(loops)
    S = np.exp(rng.uniform(np.log(1.0), np.log(10.0), m))
    J = S * rng.uniform(0.1, 1.0, m)
    for kind in range(3):
        part = np.arange(kind, m, 3)
        if not part.size:
            continue
        s, j = S[part], J[part]
        valve: Valve = (
            Choudhury(S=s, J=j), Kano(S=s, J=j), He(fs=(s + j) / 2, fd=(s - j) / 2)
        )[kind]  # fmt: skip
        yield from _stick([loops[k] for k in part], n, valve, s, j, rng)


def _stick(
    loops: list[tuple[FOPDT | IPDT, PID]],
    n: int,
    valve: Valve,
    S: Real,
    J: Real,
    rng: np.random.Generator,
) -> Iterator[VirtualLoop]:
    """Run the loops without noise for the truth, then with noise in the size of their swing."""
    m = len(loops)
    processes, controllers = [p for p, _ in loops], [c for _, c in loops]
    start = np.where(np.arange(n) < 5, 0.0, 1.0)[:, None] * S * rng.uniform(0.5, 1.5, m)
    sp = np.full((n, m), 50.0)
    quiet = simulate_batch(
        processes, controllers, t_end=n - 1.0, dt=1.0, pv0=50.0, op0=50.0, sp=sp, load=start,
        valve=valve,
    )  # fmt: skip
    late = quiet.pv[n // 3 :]
    swing = np.ptp(late, axis=0)
    middle = (late.max(axis=0) + late.min(axis=0)) / 2
    cycles = np.count_nonzero((late[1:] > middle) & (late[:-1] <= middle), axis=0) * 1.5
    slip = np.array([p.K * (1 if isinstance(p, FOPDT) else p.theta) for p in processes]) * J
    drives = (swing > DRIVEN * slip) & (cycles >= 6) & (cycles <= n / 8)
    sizes = np.maximum(swing, 0.1 * slip) * np.exp(rng.uniform(np.log(0.01), np.log(0.1), m))
    drift = (
        0.5
        * sizes
        * np.stack(
            [lfilter([np.sqrt(1 - 0.97**2)], [1.0, -0.97], rng.normal(size=n)) for _ in range(m)], 1
        )
    )
    run = simulate_batch(
        processes, controllers, t_end=n - 1.0, dt=1.0, pv0=50.0, op0=50.0, sp=sp, load=start,
        output_load=drift, noise=rng.normal(size=(n, m)) * sizes, valve=valve,
    )  # fmt: skip
    for k in range(m):
        if not run.diverged[k]:
            yield VirtualLoop(
                state=State.STICKING, sp=sp[:, k], pv=run.pv[:, k], op=run.op[:, k],
                process=processes[k], controller=controllers[k], S=float(S[k]), J=float(J[k]),
                drives=bool(drives[k]),
            )  # fmt: skip
