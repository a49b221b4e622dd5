"""Assessments with a model: whatever model and data meet, the answer is one."""

import json
import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from advice.assess import assess
from advice.assessment_body import assessment_body
from loop.controller import PID, Action
from loop.process import FOPDT, IPDT, SOPDT, Process, PureDelay, TransferFunction
from loop.record import Record
from loop.signals import Real
from monitoring.known_loop import KnownLoop

SIZES = st.floats(-6, 6).map(lambda power: 10.0**power)
TIMES = st.floats(-1, 3).map(lambda power: 10.0**power)
SIGN = st.sampled_from([-1.0, 1.0])


@st.composite
def processes(draw: st.DrawFn) -> Process:
    K, tau, other = draw(SIGN) * draw(SIZES), draw(TIMES), draw(TIMES)
    theta = draw(st.just(0.0) | TIMES)
    choices: list[Process] = [
        FOPDT(K=K, tau=tau, theta=theta),
        SOPDT(K=K, tau1=max(tau, other), tau2=min(tau, other), theta=theta),
        IPDT(K=K, theta=theta),
        PureDelay(K=K, theta=other),
        TransferFunction((-K * tau, K), (tau * other, tau + other, 1.0), theta),
        TransferFunction((K,), (tau, 1.0, 0.0), theta),
    ]
    return draw(st.sampled_from(choices))


@st.composite
def known_loops(draw: st.DrawFn) -> KnownLoop:
    process = draw(processes())
    pid = PID(
        Kc=draw(SIZES),
        Ti=draw(st.just(math.inf) | TIMES),
        Td=draw(st.just(0.0) | TIMES),
        action=draw(st.sampled_from(Action)),
    )
    return KnownLoop(
        process=process,
        controller=draw(st.none() | st.just(pid)),
        scan_time=draw(st.none() | st.sampled_from([0.1, 60.0])),
        uncertainty=draw(st.sampled_from([0.0, 0.2, 0.9])),
    )


def signal(rng: np.random.Generator, kind: str, n: int) -> Real:
    match kind:
        case "still":
            return np.zeros(n)
        case "walk":
            return np.cumsum(rng.normal(size=n))
        case "noise":
            return rng.normal(size=n)
        case "steps":
            return np.repeat(rng.integers(-1, 2, n // 100 + 1), 100)[:n].astype(float)
        case "spike":
            return np.where(np.arange(n) == n // 2, 1e6, 0.0)
        case _:
            return np.arange(float(n))


KINDS = st.sampled_from(["still", "walk", "noise", "steps", "spike", "ramp"])


@settings(max_examples=40, deadline=None)
@given(
    known_loops(), KINDS, KINDS, KINDS, SIZES, st.sampled_from([300, 1600]),
    st.integers(0, 2**32 - 1), st.sampled_from([0.5, 60.0]), st.none() | TIMES,
)  # fmt: skip
def test_any_model_meets_any_data_with_an_answer(
    known: KnownLoop, pv: str, op: str, sp: str, scale: float, n: int, seed: int, dt: float,
    tau_c: float | None,
) -> None:  # fmt: skip
    rng = np.random.default_rng(seed)
    record = Record(
        t=np.arange(n) * dt,
        pv=scale * (signal(rng, pv, n) + 0.3 * signal(rng, sp, n)),
        op=signal(rng, op, n),
        sp=scale * signal(rng, sp, n),
    )
    found = assess(record, known=known, op_range=(-1e7, 1e7), tau_c=tau_c)
    json.dumps(assessment_body(found), allow_nan=False)
