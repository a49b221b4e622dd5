"""Advice for an uncertain model holds at every process that it may be."""

import numpy as np
import pytest

from loop.batch import ProcessBatch
from loop.margins import margins
from loop.process import FOPDT
from tuning.answer import Tunings, tunings
from tuning.profiles import PROFILES
from tuning.withstanding import holding, withstanding

MODEL = FOPDT(K=2.0, tau=60.0, theta=10.0)
GENERAL = PROFILES["general"]


def batch(*processes: FOPDT) -> ProcessBatch:
    return ProcessBatch(
        K=np.array([p.K for p in processes]),
        tau1=np.array([p.tau for p in processes]),
        tau2=np.zeros(len(processes)),
        integrators=np.zeros(len(processes), dtype=np.intp),
        theta=np.array([p.theta for p in processes]),
    )


@pytest.fixture(scope="module")
def answer() -> Tunings:
    return tunings(MODEL, GENERAL)


def test_settings_that_hold_everywhere_stay_recommended(answer: Tunings) -> None:
    held = withstanding(answer, MODEL, batch(MODEL))
    assert held.recommendation.index == answer.recommendation.index
    assert "also holds at each of 1" in held.recommendation.reason


def test_another_rule_takes_over_where_the_best_does_not_hold(answer: Tunings) -> None:
    longer = FOPDT(K=2.2, tau=60.0, theta=17.0)
    held = withstanding(answer, MODEL, batch(MODEL, longer))
    index = held.recommendation.index
    assert index is not None
    assert index != answer.recommendation.index
    pid = held.tunings[index].proposal.pid
    assert pid is not None
    for process in (MODEL, longer):
        found = margins(process, pid)
        assert found.gain >= GENERAL.gain
        assert found.phase >= GENERAL.phase
        assert found.Ms <= GENERAL.Ms


def test_simc_is_slowed_down_where_no_rule_holds(answer: Tunings) -> None:
    far = FOPDT(K=6.0, tau=30.0, theta=60.0)
    held = withstanding(answer, MODEL, batch(MODEL, far))
    assert held.recommendation.index == len(answer.tunings)
    slower = held.tunings[-1].proposal
    assert slower.pid is not None
    assert slower.tau_c is not None
    assert slower.tau_c > 60.0
    assert margins(far, slower.pid).Ms <= GENERAL.Ms


def test_processes_of_both_signs_leave_nothing_to_recommend(answer: Tunings) -> None:
    held = withstanding(answer, MODEL, batch(MODEL, FOPDT(K=-2.0, tau=60.0, theta=10.0)))
    assert held.recommendation.index is None
    assert "better data are needed" in held.recommendation.reason


def test_an_answer_without_a_recommendation_stays_one(answer: Tunings) -> None:
    none = withstanding(answer, MODEL, batch(FOPDT(K=-2.0, tau=60.0, theta=10.0)))
    assert withstanding(none, MODEL, batch(MODEL)) is none


def test_no_settings_hold_nowhere() -> None:
    assert holding([], batch(MODEL), GENERAL).size == 0


def test_without_any_dead_time_nothing_bounds_how_slow_is_enough() -> None:
    quick = FOPDT(K=2.0, tau=60.0, theta=0.0)
    found = tunings(quick, GENERAL, tau_c=20.0)
    assert found.recommendation.index is not None
    held = withstanding(found, quick, batch(quick, FOPDT(K=-2.0, tau=60.0, theta=0.0)))
    assert held.recommendation.index is None
