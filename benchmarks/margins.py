"""Margins of many loops at once against python-control, each against an exact solution."""

import math
from collections.abc import Callable
from functools import partial, reduce
from typing import TypeAlias

import control
import numpy as np

from benchmarks.exact_margins import Plant, exact_margins, loop_gain
from benchmarks.section import Section, Target
from benchmarks.timing import Timing, Work, duration, interleaved
from loop.batch import PIDBatch, ProcessBatch
from loop.margin_batch import batch_margins
from loop.signals import Real

Five: TypeAlias = tuple[float, ...]
Peer: TypeAlias = Callable[[Plant], Five]
FACTORS = (0.5, 0.75, 1.0, 1.25, 1.5)
SPREAD = 2_000
CHECKED = 60
# python-control is timed on few loops, and checked on every fifth of those that are.
TIMED = 3
PEER_STRIDE = 5


def heater_grid() -> list[Plant]:
    """Vary gain, lag and dead time of the heater by +-50 % around one PID: 125 loops."""
    return [
        Plant(K=2 * k, tau1=120 * lag, theta=30 * dead, Kc=0.45, Ti=135, Td=13.3)
        for k in FACTORS
        for lag in FACTORS
        for dead in FACTORS
    ]


def random_lags(seed: int = 2) -> list[Plant]:
    """Draw FOPDT processes over three decades of theta/tau, each with SIMC's PI."""
    rng = np.random.default_rng(seed)
    plants = []
    for _ in range(SPREAD):
        tau, theta = 10 ** rng.uniform(0, 3), 10 ** rng.uniform(0, 2)
        K, tau_c = 10 ** rng.uniform(-1, 1), theta * rng.uniform(0.7, 3)
        Kc, Ti = tau / (K * (tau_c + theta)), min(tau, 4 * (tau_c + theta))
        plants.append(Plant(K=K, tau1=tau, theta=theta, Kc=Kc, Ti=Ti))
    return plants


def random_second_orders(seed: int = 3) -> list[Plant]:
    """Draw SOPDT processes, each with SIMC's PID, the series form turned into ISA."""
    rng = np.random.default_rng(seed)
    plants = []
    for _ in range(SPREAD):
        tau1, theta = 10 ** rng.uniform(0.5, 2.5), 10 ** rng.uniform(0, 1.5)
        tau2, K = tau1 * rng.uniform(0.05, 1), 10 ** rng.uniform(-1, 1)
        tau_c = theta * rng.uniform(1, 3)
        Kc, Ti = tau1 / (K * (tau_c + theta)), min(tau1, 4 * (tau_c + theta))
        factor = 1 + tau2 / Ti
        plants.append(
            Plant(
                K=K,
                tau1=tau1,
                tau2=tau2,
                theta=theta,
                Kc=Kc * factor,
                Ti=Ti * factor,
                Td=tau2 / factor,
            )
        )
    return plants


def random_integrators(seed: int = 4) -> list[Plant]:
    """Draw integrating processes with dead time, each with SIMC's PI."""
    rng = np.random.default_rng(seed)
    plants = []
    for _ in range(SPREAD):
        theta, K = 10 ** rng.uniform(0, 2), 10 ** rng.uniform(-3, 0)
        tau_c = theta * rng.uniform(0.7, 3)
        plants.append(
            Plant(
                K=K,
                tau1=0.0,
                integrators=1,
                theta=theta,
                Kc=1 / (K * (tau_c + theta)),
                Ti=4 * (tau_c + theta),
            )
        )
    return plants


def _numbers(plants: list[Plant], name: str) -> Real:
    return np.array([getattr(plant, name) for plant in plants])


def as_batch(plants: list[Plant]) -> tuple[ProcessBatch, PIDBatch]:
    """Hold the loops as arrays."""
    processes = ProcessBatch(
        K=_numbers(plants, "K"),
        tau1=_numbers(plants, "tau1"),
        tau2=_numbers(plants, "tau2"),
        integrators=_numbers(plants, "integrators").astype(int),
        theta=_numbers(plants, "theta"),
    )
    controllers = PIDBatch(
        Kc=_numbers(plants, "Kc"),
        Ti=_numbers(plants, "Ti"),
        Td=_numbers(plants, "Td"),
        N=_numbers(plants, "N"),
    )
    return processes, controllers


def with_loopwright(plants: list[Plant]) -> list[Five]:
    """Compute all margins of all loops in one call."""
    found = batch_margins(*as_batch(plants))
    five = (found.gain, found.phase, found.delay, found.Ms, found.Mt)
    return list(zip(*(numbers.tolist() for numbers in five), strict=True))


def with_pade(plant: Plant, order: int) -> Five:
    """Compute the margins with python-control, the dead time as a Padé approximation."""
    Tf = plant.Td / plant.N
    n, d = control.pade(plant.theta, order)
    numerators = [[plant.K * plant.Kc], [plant.Ti * (plant.Td + Tf), plant.Ti + Tf, 1.0], n]
    lags = [[lag, 1.0] for lag in (plant.tau1, plant.tau2, Tf) if lag]
    denominators = [[1.0] + [0.0] * plant.integrators, [plant.Ti, 0.0], *lags, d]
    L = control.tf(reduce(np.polymul, numerators), reduce(np.polymul, denominators))
    gain, phase, distance, _, wc, ws = control.stability_margins(L)
    w = ws * np.geomspace(0.01, 10, 200)
    at = L(1j * w)
    Mt = max(1.0, float(np.max(np.abs(at / (1 + at)))))
    return float(gain), float(phase), math.radians(phase) / float(wc), 1 / float(distance), Mt


def with_exact_data(plant: Plant) -> Five:
    """Compute the margins with python-control from 1,000 points of the exact response."""
    w = np.geomspace(1e-3, 1e2, 1_000) / plant.theta
    L = loop_gain(plant, w) * np.exp(-1j * w * plant.theta)
    gain, phase, distance, _, wc, _ = control.stability_margins(control.frd(L, w, smooth=True))
    Mt = max(1.0, float(np.max(np.abs(L / (1 + L)))))
    return float(gain), float(phase), math.radians(phase) / float(wc), 1 / float(distance), Mt


PEERS: dict[str, Peer] = {
    "python-control, Padé 3": partial(with_pade, order=3),
    "python-control, Padé 10": partial(with_pade, order=10),
    "python-control, 1,000 exact points": with_exact_data,
}


def relative_errors(found: list[Five], exact: list[Five]) -> Real:
    """Take the largest relative error of each of the five numbers over all loops.

    Parameters
    ----------
    found, exact : list of tuple of float
        Gain, phase, delay, Ms, Mt of the same loops.

    Returns
    -------
    ndarray, shape (5,)
    """
    a, b = np.array(found), np.array(exact)
    same = (a == b) | (np.isinf(a) & np.isinf(b))
    with np.errstate(invalid="ignore"):
        errors = np.where(same, 0.0, np.abs(a - b) / np.abs(b))
    return np.asarray(np.max(errors, axis=0))


def _cells(timing: Timing, loops: int, errors: Real) -> tuple[str, ...]:
    time = f"{duration(timing.median / loops)} ({duration(timing.best / loops)})"
    return (time, *(f"{error:.0e}" for error in errors))


def compare(work: str, plants: list[Plant]) -> tuple[list[tuple[str, ...]], list[Target]]:
    """Measure one set of loops: rows of the table, and the targets on speed and error.

    Parameters
    ----------
    work : str
        Name of the set.
    plants : list of Plant
        Stable loops.
    """
    few = plants[:: max(1, len(plants) // CHECKED)][:CHECKED]
    exact = [exact_margins(plant) for plant in few]
    works: dict[str, Work] = {"Loopwright": partial(with_loopwright, plants)}
    for name, peer in PEERS.items():
        works[name] = partial(_each, peer, few[:TIMED])
    timings = interleaved(works, repeats=15, seconds=5.0)
    errors = relative_errors(with_loopwright(few), exact)
    rows = [(work, "Loopwright", *_cells(timings["Loopwright"], len(plants), errors))]
    for name, peer in PEERS.items():
        peer_errors = relative_errors(_each(peer, few[::PEER_STRIDE]), exact[::PEER_STRIDE])
        rows.append((work, name, *_cells(timings[name], TIMED, peer_errors)))
    ours = timings["Loopwright"].median / len(plants)
    best = min(timings[name].median for name in PEERS) / TIMED
    speed = Target(
        what=f"{work}, against the fastest python-control",
        limit=100.0,
        reached=best / ours,
        unit="times",
        at_least=True,
    )
    error = Target(
        what=f"{work}, largest relative error", limit=1e-8, reached=float(np.max(errors)), unit=""
    )
    return rows, [speed, error]


def _each(peer: Peer, plants: list[Plant]) -> list[Five]:
    return [peer(plant) for plant in plants]


def run() -> Section:
    """Measure on a +-50 % grid and on random loops of three kinds."""
    rows, targets = [], []
    for work, plants in {
        "125 heaters, PID": heater_grid(),
        f"{SPREAD:,} FOPDT, PI": random_lags(),
        f"{SPREAD:,} SOPDT, PID": random_second_orders(),
        f"{SPREAD:,} integrators, PI": random_integrators(),
    }.items():
        more_rows, more_targets = compare(work, plants)
        rows += more_rows
        targets += more_targets
    return Section(
        title="Margins of many loops",
        how=(
            "Time for one loop out of a batch, and the largest relative error over "
            f"{CHECKED} of the loops (python-control: {CHECKED // PEER_STRIDE}) against an "
            "independent solution: 20,000 points of the exact response, a root search at each "
            "crossing. Loopwright's time includes the stability "
            "test, python-control's does not."
        ),
        columns=("loops", "by", "time a loop", "gain", "phase", "delay", "Ms", "Mt"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            "python-control has no dead time: it gets a Padé approximation, or the exact response "
            "as data, between which it interpolates. It has no Mt: the largest of the points, 200 "
            "around the peak of S under Padé, is taken.",
        ),
    )
