"""Bands over uncertain processes in the report: the numbers of the simulation, said in words."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from advice.report.fan_figures import fan_figures, processes_of
from advice.report.loop_figures import Candidate
from advice.tune import TuningCase, tune, tune_process
from identification.draws import parameter_draws
from loop.controller import PID
from loop.process import FOPDT
from loop.record import Record
from loop.simulation import simulate

CALM, WILD = PID(Kc=0.5, Ti=120), PID(Kc=3.0, Ti=120)


@pytest.fixture(scope="module")
def stated() -> TuningCase:
    return tune_process(FOPDT(K=2, tau=120, theta=30))


def test_the_band_holds_what_each_process_does(stated: TuningCase) -> None:
    drawn: Any = fan_figures(
        stated, [Candidate(name="calm", pid=CALM)], set_point=5.0, load=2.0, pv="degC"
    )
    assert list(drawn) == ["fan_setpoint", "fan_load"]
    found = processes_of(stated)
    assert found is not None
    processes, _ = found
    figure, caption = drawn["fan_load"]
    low, high, middle = figure["data"][:3]
    t = np.array(low["x"])
    dt = t[1]
    pvs = [
        simulate(
            FOPDT(K=float(K), tau=float(tau), theta=float(theta)),
            CALM,
            t_end=t[-1],
            dt=dt,
            load=2.0,
        ).pv[: t.size]
        for K, tau, theta in zip(processes.K, processes.tau1, processes.theta, strict=True)
    ]
    for curve, share in ((low, 0.05), (middle, 0.5), (high, 0.95)):
        np.testing.assert_allclose(curve["y"], np.quantile(pvs, share, axis=0), atol=2e-4)
    assert high["fill"] == "tonexty"
    assert "Load step on 100 processes with all parameters off at once by up to ±25 %" in caption
    assert "[degC]" in figure["layout"]["yaxis"]["title"]["text"]


def test_a_record_tells_which_processes_are_possible(heater_test: Record) -> None:
    case = tune(heater_test)
    found = processes_of(case)
    assert found is not None
    processes, words = found
    assert case.model is not None
    np.testing.assert_array_equal(processes.K, parameter_draws(case.model, n=100)[:, 0])
    assert words == "100 processes that the record cannot tell from the model"
    # Without the errors of the fit there is nothing to draw from.
    untold = replace(case, model=replace(case.model, choice=None))
    assert "all parameters off at once" in (processes_of(untold) or ("", ""))[1]


def test_loops_that_grow_are_counted_and_alone_leave_no_picture(stated: TuningCase) -> None:
    both = [Candidate(name="calm", pid=CALM), Candidate(name="wild", pid=WILD)]
    drawn = fan_figures(stated, both, set_point=5.0, load=2.0, pv="degC")
    assert "calm: largest move" in drawn["fan_load"][1]
    hopeless = [Candidate(name="hopeless", pid=PID(Kc=1e6, Ti=120))]
    assert fan_figures(stated, hopeless, set_point=5.0, load=2.0, pv="degC") == {}
    nothing = TuningCase(
        profile=stated.profile, record=None, model=None, relay=None, process=None, tunings=(),
        recommended=None, recommended_reason="none",
    )  # fmt: skip
    assert fan_figures(nothing, both, set_point=5.0, load=2.0, pv="degC") == {}
