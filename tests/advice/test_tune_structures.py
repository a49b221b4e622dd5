"""A record of another structure than one lag goes all the way to settings that hold on it."""

import json

import numpy as np
import pytest
from scipy.signal import lsim

from advice.case_body import case_body
from advice.facts import model_facts
from advice.tune import TuningCase, tune
from loop.margins import margins
from loop.process import IPDT, Process, PureDelay, TransferFunction
from loop.record import Record

T = np.arange(0.0, 600.0, 2.0)
STEP = np.where(T < 100, 40.0, 50.0)
PULSE = np.where(T < 160, STEP, 40.0)
DOUBLET = np.where((T >= 160) & (T < 220), 30.0, PULSE)
LAGS = (43.5 * 16.5, 60.0, 1.0)
PROCESSES = {
    "inverse": (TransferFunction((-60.0, 2.0), LAGS, 12.0), STEP),
    "lead": (TransferFunction((180.0, 2.0), LAGS, 12.0), STEP),
    "delay": (PureDelay(K=-2.0, theta=12.0), DOUBLET),
    "integrator with lag": (TransferFunction((0.01,), (30.0, 1.0, 0.0), 12.0), PULSE),
}


def tuned(process: Process, op: np.ndarray) -> TuningCase:
    late = np.concatenate((np.full(6, op[0]), op[:-6])) - op[0]
    pv = 20 + lsim((process.numerator, process.denominator), late, T, interp=False)[1]
    noisy = pv + np.random.default_rng(0).normal(0, 0.05, T.size)
    return tune(Record(t=T, pv=noisy, op=op))


@pytest.mark.parametrize("name", PROCESSES)
def test_what_is_recommended_holds_on_the_true_process(name: str) -> None:
    true, op = PROCESSES[name]
    case = tuned(true, op)
    kinds = {"delay": PureDelay, "integrator with lag": IPDT}
    assert isinstance(case.process, kinds.get(name, TransferFunction))
    assert case.best is not None
    assert case.best.proposal.pid is not None
    assert margins(true, case.best.proposal.pid).Ms < 2.0
    body = case_body(case)
    assert json.loads(json.dumps(body, allow_nan=False)) == body
    model = body["model"]
    assert isinstance(model, dict)
    assert model["kind"] in ("FOPDT", "SOPDT", "IPDT", "PureDelay")
    structure, candidates = model["structure"], model["candidates"]
    assert isinstance(structure, dict)
    assert isinstance(candidates, list)
    assert structure in candidates
    assert set(structure["parameters"]) == set(structure["standard_errors"])
    facts = dict(model_facts(case))
    assert facts["process"] == structure["formula"]
    assert "criterion" in facts["runner-up"]
