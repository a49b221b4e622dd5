"""Proofs over boxes against random plants in them, and the time that proofs and optima take."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.section import Section, Target
from benchmarks.timing import duration
from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.margin_batch import batch_margins
from loop.process import FOPDT, IPDT, SOPDT
from loop.signals import Real
from tuning.box_proof import BoxProof, prove_box
from tuning.loop_limits import LoopLimits
from tuning.optimal_robust import optimal_over_box, optimal_over_draws
from tuning.profiles import PROFILES

BOXES, PLANTS = 200, 500
REPEATS = 5
GENERAL = LoopLimits.of(PROFILES["general"])
HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)
LagProcess = FOPDT | SOPDT | IPDT


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A loop with a box."""

    process: LagProcess
    controller: PID
    error: float


def random_cases(count: int = BOXES, seed: int = 5) -> list[Case]:
    """Draw loops of three kinds, PI and PID about SIMC's speed, with boxes of ±5 to ±50 %."""
    rng = np.random.default_rng(seed)
    cases = []
    for i in range(count):
        theta, error = 10 ** rng.uniform(0, 2), rng.uniform(0.05, 0.5)
        tau = theta * 10 ** rng.uniform(-0.5, 1.5)
        K, speed = 10 ** rng.uniform(-1, 1), theta * rng.uniform(1.2, 6)
        Ti, Td = min(tau, 4 * speed), float(rng.choice([0.0, 0.3])) * theta
        process: LagProcess
        match i % 4:
            case 0 | 1:
                process, Kc = FOPDT(K=K, tau=tau, theta=theta), tau / (K * speed)
            case 2:
                process = SOPDT(K=K, tau1=tau, tau2=tau * rng.uniform(0.05, 0.3), theta=theta)
                Kc = tau / (K * (speed + process.tau2))
            case _:
                process, Kc = IPDT(K=K / tau, theta=theta), tau / (K * speed)
                Ti = 4 * speed
        cases.append(Case(process=process, controller=PID(Kc=Kc, Ti=Ti, Td=Td), error=error))
    return cases


def random_plants(case: Case, count: int, rng: np.random.Generator) -> ProcessBatch:
    """Draw plants in a box, a third of them on its edges."""
    factors = rng.uniform(1 - case.error, 1 + case.error, (4, count))
    edge = rng.random((4, count)) < 1 / 3
    factors = np.where(edge, 1 + case.error * rng.choice([-1.0, 1.0], (4, count)), factors)
    model = ProcessBatch.of(case.process)
    return ProcessBatch(
        K=model.K * factors[0],
        tau1=model.tau1 * factors[1],
        tau2=model.tau2 * factors[2],
        integrators=model.integrators,
        theta=model.theta * factors[3],
    )


def beaten(case: Case, proof: BoxProof, rng: np.random.Generator, count: int = PLANTS) -> int:
    """Count random plants with a margin beyond the bound, by more than rounding."""
    found = batch_margins(random_plants(case, count, rng), PIDBatch.of(case.controller))
    over = ~found.stable if proof.stable else np.zeros(count, dtype=bool)
    for name, worst in proof.worst.items():
        values: Real = getattr(found, name)
        if name in ("Ms", "Mt"):
            over |= values > worst.bound * (1 + 1e-9)
        else:
            over |= values < worst.bound * (1 - 1e-9)
    return int(np.count_nonzero(over))


def processor_time(work: Callable[[], object]) -> float:
    """Least processor time of some calls. [s]"""
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def run() -> Section:
    """Try to beat the bounds, and measure the gaps and the times."""
    rng = np.random.default_rng(6)
    cases = random_cases()
    rows, total, gaps, times = [], 0, [], []
    for kind in ("FOPDT", "SOPDT", "IPDT"):
        own = [case for case in cases if type(case.process).__name__ == kind]
        proofs, spent = [], []
        for case in own:
            start = time.process_time()
            proofs.append(prove_box(case.process, case.controller, errors=(case.error,) * 3))
            spent.append(time.process_time() - start)
        lost = sum(beaten(case, proof, rng) for case, proof in zip(own, proofs, strict=True))
        gap = [max(worst.gap for worst in proof.worst.values()) for proof in proofs]
        rows.append(
            (
                kind,
                str(len(own)),
                str(sum(proof.stable is False for proof in proofs)),
                f"{len(own) * PLANTS:,}",
                str(lost),
                f"{100 * max(gap):.2f} %",
                f"{duration(float(np.median(spent)))} ({duration(max(spent))})",
            )
        )
        total += lost
        gaps += gap
        times += spent
    draws = np.array([2.0, 120.0, 30.0]) * np.exp(
        np.array([0.15, 0.2, 0.15]) * rng.standard_normal((200, 3))
    )
    heater = PID(Kc=0.45, Ti=135.0, Td=13.3)
    one = processor_time(partial(prove_box, HEATER, heater))
    robust = processor_time(partial(optimal_over_box, HEATER, GENERAL, structure="PID"))
    many = processor_time(partial(optimal_over_draws, HEATER, draws, GENERAL, structure="PID"))
    return Section(
        title="Proofs over whole boxes",
        how=(
            f"{BOXES} random loops of three kinds with boxes of ±5 to ±50 % of every parameter at "
            f"once; {PLANTS} random plants in each, a third of their parameters at an end. A plant "
            "counts as beating the bound where any of its five margins passes it by 1e-9. Times "
            "are processor times, median and longest."
        ),
        columns=(
            "loops",
            "boxes",
            "with an unstable plant",
            "random plants",
            "beat the bound",
            "largest gap to a plant found",
            "time a box",
        ),
        rows=tuple(rows),
        targets=(
            Target(what="random plants that beat the bound", limit=0, reached=total, unit=""),
            Target(what="largest gap", limit=1.0, reached=100 * max(gaps), unit="%"),
            Target(what="proof of the heater's box", limit=50, reached=1e3 * one, unit="ms"),
            Target(
                what="median proof of a random box",
                limit=50,
                reached=1e3 * float(np.median(times)),
                unit="ms",
            ),
            Target(
                what="robust optimal PID of the heater, ±50 %",
                limit=100,
                reached=1e3 * robust,
                unit="ms",
            ),
            Target(
                what="robust optimal PID over 200 draws",
                limit=1000,
                reached=1e3 * many,
                unit="ms",
            ),
        ),
    )
