"""One tuning request: every rule, every margin, every ±50 % sweep, the recommendation."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from advice.case_body import case_body
from advice.tune import TuningCase, tune, tune_process
from benchmarks.exact_margins import Plant
from benchmarks.margins import with_pade
from benchmarks.section import Section, Target
from benchmarks.step_tests import heater_test
from benchmarks.timing import Work, duration, interleaved
from loop.controller import PID
from loop.process import FOPDT, IPDT, SOPDT
from loop.record import Record

LIMIT = 0.050
SAMPLES = 2_000
HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)
PROCESSES: Mapping[str, FOPDT | SOPDT | IPDT] = {
    "FOPDT": HEATER,
    "SOPDT": SOPDT(K=2.0, tau1=120.0, tau2=40.0, theta=20.0),
    "IPDT": IPDT(K=0.01, theta=30.0),
}


def answer(process: FOPDT | SOPDT | IPDT) -> TuningCase:
    """Tune a stated process and write the answer's body."""
    case = tune_process(process)
    case_body(case)
    return case


def answer_from_data(record: Record) -> TuningCase:
    """Identify, tune and write the answer's body."""
    case = tune(record)
    case_body(case)
    return case


def record_of_the_heater() -> Record:
    """Take the step test of the fit benchmark as a record."""
    test = heater_test(SAMPLES, 1)
    return Record(t=test.t, pv=test.pv, op=test.op)


def _controllers(case: TuningCase) -> list[PID]:
    proposals = [tuning.proposal.pid for tuning in case.tunings]
    return [pid for pid in proposals if pid is not None]


def _with_control(controllers: list[PID]) -> None:
    """Compute margins on one plant with python-control, Padé 3, for controllers that integrate."""
    for pid in controllers:
        with_pade(
            Plant(
                K=HEATER.K,
                tau1=HEATER.tau,
                theta=HEATER.theta,
                Kc=pid.Kc,
                Ti=pid.Ti,
                Td=pid.Td,
                N=pid.N,
            ),
            3,
        )


def run() -> Section:
    """Measure requests for three processes and for a record."""
    works: dict[str, Work] = {name: partial(answer, process) for name, process in PROCESSES.items()}
    works["step test"] = partial(answer_from_data, record_of_the_heater())
    case = answer(HEATER)
    some = [pid for pid in _controllers(case) if np.isfinite(pid.Ti)][:5]
    works["python-control"] = partial(_with_control, some)
    timings = interleaved(works, repeats=31, seconds=15.0)
    rows, targets = [], []
    for name, work in list(works.items())[:-1]:
        found = work()
        assert isinstance(found, TuningCase)
        title = f"{name}, {SAMPLES:,} samples" if name == "step test" else name
        settings = len(_controllers(found))
        timing = timings[name]
        rows.append(
            (
                title,
                "Loopwright",
                f"{settings} settings, {settings * _plants(found):,} loops",
                f"{duration(timing.median)} ({duration(timing.best)})",
            )
        )
        targets.append(
            Target(what=title, limit=LIMIT * 1e3, reached=timing.median * 1e3, unit="ms")
        )
    peer = timings["python-control"]
    loops = len(_controllers(case)) * _plants(case)
    scaled = peer.median / len(some) * loops
    rows.append(
        (
            "FOPDT",
            "python-control, Padé 3",
            f"margins of {loops:,} loops, scaled up from {len(some)}",
            duration(scaled),
        )
    )
    return Section(
        title="One tuning request",
        how=(
            "Every structure of every rule, its margins at the model, at eleven factors of each "
            "parameter and at the joint corners, the verdict, the recommendation and the body of "
            "the answer as REST sends it. The step test is identified first."
        ),
        columns=("request", "by", "work", "time"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            "No peer tunes by published rules and verifies the result. python-control stands for "
            "the margins alone, without a stability test.",
        ),
    )


def _plants(case: TuningCase) -> int:
    """Plants that every setting was verified on."""
    verified = [tuning.verification for tuning in case.tunings if tuning.verification is not None]
    return 1 + verified[0].sweep.Ms.size + verified[0].corners.Ms.size if verified else 0
