"""The scan loop itself, once in floats for one loop and once in arrays for many.

Both run the law printed at `ScanLaw` line for line, in deviations from the initial rest. Floats
are ten times faster for one loop, arrays ten times faster for a thousand.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from operator import mul
from typing import Self

import numpy as np

from loop.digital_pid import AntiWindup, ScanLaw
from loop.errors import LoopDiverged
from loop.experiment import Experiment
from loop.sampled_process import SampledProcesses
from loop.signals import Real

# Far beyond any plant in any unit, far below where floats overflow.
DIVERGED = 1e30


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """Everything a scan meets, as deviations from rest.

    Attributes
    ----------
    sp, load, disturbance, noise : ndarray, shape (n,) or (n, m)
        Set point, load at the process input, disturbance and noise of PV.
    low, high : float
        Limits of the output. [OP]
    move : float
        Largest change of the output in one scan. [OP]
    clamps : bool
        Whether the integral holds while the output is at a limit.
    resolution, pv0 : float
        Smallest change that the sensor shows and the PV at rest. [PV]
    dt : float
        Scan time. [s]
    """

    sp: Real
    load: Real
    disturbance: Real
    noise: Real
    low: float
    high: float
    move: float
    clamps: bool
    resolution: float
    pv0: float
    dt: float

    @classmethod
    def of(cls, experiment: Experiment, *, loops: int | None = None) -> Self:
        """Refer an experiment to rest; noise is drawn here, for each of `loops` if given.

        Raises
        ------
        ValueError
            A signal has neither one value a scan nor one a scan and loop.
        """
        t, limits = experiment.t, experiment.limits
        signals = {
            "sp": experiment.set_point(t) - experiment.pv0,
            "load": experiment.input_load(t),
            "output_load": experiment.output_disturbance(t),
            "noise": experiment.measurement_noise(t, loops),
        }
        for name, signal in signals.items():
            if signal.shape not in ((t.size,), (t.size, loops)):
                good = f"({t.size},)" if loops is None else f"({t.size},) or ({t.size}, {loops})"
                raise ValueError(f"{name} must have the shape {good}, got {signal.shape}")
        return cls(
            sp=signals["sp"],
            load=signals["load"],
            disturbance=signals["output_load"],
            noise=signals["noise"],
            low=limits.low - experiment.op0,
            high=limits.high - experiment.op0,
            move=limits.rate * experiment.dt,
            clamps=experiment.anti_windup is AntiWindup.CLAMPING,
            resolution=experiment.resolution,
            pv0=experiment.pv0,
            dt=experiment.dt,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Traces:
    """True PV, measured PV and output of every scan, shape (n,) or (n, m), deviations from rest."""

    true_pv: Real
    pv: Real
    op: Real


def scan_one(plant: SampledProcesses, law: ScanLaw, course: Course) -> Traces:
    """Run one loop whose process has at most two states, in plain floats.

    Raises
    ------
    LoopDiverged
        The loop grows without bound.
    """
    kP, kI, kD, dD, b, c, dF, f0, f1, track = (float(a[0]) for a in law.arrays())
    a11, a12, a21, a22, late1, late2, early1, early2, c1, c2, D = _two_states(plant)
    pv0, resolution = course.pv0, course.resolution
    low, high, move, clamps = course.low, course.high, course.move, course.clamps
    inputs = [0.0] * int(plant.q[0])
    x1 = x2 = integral = derivative = lagged = u = late = 0.0
    r_old = m_old = w_old = v_old = 0.0
    true_pv, pv, op = [], [], []
    signals = (course.sp, course.load, course.disturbance, course.noise)
    rows = zip(*(signal.tolist() for signal in signals), strict=True)
    for k, (r, load, disturbance, noise) in enumerate(rows):
        y = c1 * x1 + c2 * x2 + D * late + disturbance
        m = y + noise
        if not -DIVERGED < m < DIVERGED:
            raise LoopDiverged(k * course.dt)
        if resolution:
            m = round((m + pv0) / resolution) * resolution - pv0
        w = c * r - m
        derivative = dD * derivative + kD * (w - w_old)
        added = kI * (r_old - 0.5 * (m + m_old))
        integral += added
        v = kP * (b * r - m) + integral + derivative
        lagged = dF * lagged + f1 * v_old + f0 * v if dF else v
        floor, ceiling = u - move, u + move
        u = lagged
        if u < floor:
            u = floor
        elif u > ceiling:
            u = ceiling
        if u < low:
            u = low
        elif u > high:
            u = high
        if u != lagged:
            if clamps:
                if (lagged - u) * added > 0:
                    integral -= added
            else:
                integral += track * (u - lagged)
        inputs.append(u + load)
        early = inputs[k]
        x1, x2 = (
            a11 * x1 + a12 * x2 + late1 * late + early1 * early,
            a21 * x1 + a22 * x2 + late2 * late + early2 * early,
        )
        r_old, m_old, w_old, v_old, late = r, m, w, v, early
        true_pv.append(y)
        pv.append(m)
        op.append(u)
    return Traces(true_pv=np.array(true_pv), pv=np.array(pv), op=np.array(op))


def _two_states(plant: SampledProcesses) -> list[float]:
    """Phi row by row, late, early, C and D of the first process, filled up to two states."""
    missing = 2 - plant.C.shape[1]
    Phi = np.pad(plant.Phi[0], (0, missing))
    vectors = [np.pad(v[0], (0, missing)) for v in (plant.late, plant.early, plant.C)]
    return [float(a) for a in np.concatenate([Phi.ravel(), *vectors, plant.D[:1]])]


def scan_many(plant: SampledProcesses, law: ScanLaw, course: Course) -> Traces:
    """Run m loops at once; one that diverges runs on to infinity without stopping the others."""
    kP, kI, kD, dD, b, c, dF, f0, f1, track = law.arrays()
    scans, loops = course.sp.shape[0], kP.size
    C, D, moved = plant.C.T.copy(), plant.D, _motion(plant)
    longest = int(plant.q.max())
    # Row k + longest holds the input of scan k; every loop looks back by its own dead time.
    inputs = np.zeros((longest + scans, loops))
    look_back = (longest - plant.q) * loops + np.arange(loops)
    x: list[Real] = [np.zeros(loops)] * plant.C.shape[1]
    lags, feeds_through = bool(np.any(dF)), bool(np.any(D))
    rest: Real = np.zeros(loops)
    integral = derivative = lagged = u = late = rest
    m_old = w_old = v_old = r_old = rest
    true_pv, pv, op = (np.empty((scans, loops)) for _ in range(3))
    signals = (course.sp, course.load, course.disturbance, course.noise)
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (r, load, disturbance, noise) in enumerate(zip(*map(_rows, signals), strict=True)):
            y = sum(map(mul, C, x), disturbance)
            if feeds_through:
                y = y + D * late
            m = np.add(y, noise, out=pv[k])
            if course.resolution:
                m[:] = np.round((m + course.pv0) / course.resolution) * course.resolution
                m -= course.pv0
            w = c * r - m
            derivative = dD * derivative + kD * (w - w_old)
            added = kI * (r_old - 0.5 * (m + m_old))
            integral = integral + added
            v = kP * (b * r - m) + integral + derivative
            lagged = dF * lagged + f1 * v_old + f0 * v if lags else v
            u = _limited(lagged, u, course, op[k])
            if course.clamps:
                integral = np.where((lagged - u) * added > 0, integral - added, integral)
            else:
                integral = integral + track * (u - lagged)
            np.add(u, load, out=inputs[k + longest])
            early = inputs.take(look_back + k * loops)
            x = moved(x, late, early)
            true_pv[k] = y
            r_old, m_old, w_old, v_old, late = r, m, w, v, early
    return Traces(true_pv=true_pv, pv=pv, op=op)


def _rows(signal: Real) -> Iterable[Real]:
    """One row a scan; what all loops share goes as plain numbers, which numpy adds faster."""
    return signal.tolist() if signal.ndim == 1 else signal


def _limited(lagged: Real, u: Real, course: Course, out: Real) -> Real:
    if course.move < math.inf:
        lagged = np.minimum(np.maximum(lagged, u - course.move), u + course.move)
    return np.minimum(np.maximum(lagged, course.low, out=out), course.high, out=out)


def _motion(plant: SampledProcesses) -> Callable[[list[Real], Real, Real], list[Real]]:
    """Prepare x[k+1] = Phi x[k] + late u[k-q-1] + early u[k-q], zeros of Phi left out."""
    states = range(plant.C.shape[1])
    late_weights, early_weights = plant.late.T.copy(), plant.early.T.copy()
    couplings = [
        [(plant.Phi[:, i, j].copy(), j) for j in states if np.any(plant.Phi[:, i, j])]
        for i in states
    ]

    def moved(x: list[Real], late: Real, early: Real) -> list[Real]:
        pushes = [late_weights[i] * late + early_weights[i] * early for i in states]
        return [
            sum((a * x[j] for a, j in row), push)
            for row, push in zip(couplings, pushes, strict=True)
        ]

    return moved
