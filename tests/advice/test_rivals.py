"""What else a record may mean is taken into account before anything is recommended."""

from dataclasses import replace

import numpy as np
import pytest

from advice.identifying import identified
from advice.rivals import rivals
from advice.tune import tune
from identification.verdict import Verdict
from loop.margins import margins
from loop.open_loop import process_output
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator
from loop.record import Record

PROCESS = FOPDT(K=2.0, tau=60.0, theta=10.0)


def test_a_move_hidden_in_a_gap_counts_as_later_than_it_shows() -> None:
    t = np.arange(900.0)
    op = np.where(t < 300, 40.0, 45.0)
    pv = process_output(PROCESS, t, op) + np.random.default_rng(1).normal(0.0, 0.05, t.size)
    kept = (t < 285) | (t >= 305)
    record = Record(t=t[kept], pv=pv[kept], op=op[kept])
    found = rivals(record, identified(record))
    assert found is not None
    assert any("may have moved 21 s before" in note for note in found.notes)
    assert found.processes.theta.max() > 20.0


def test_a_load_that_passes_for_a_part_of_the_answer_is_seen_by_the_whitened_fit() -> None:
    t = np.arange(1500.0)
    op = np.where(t < 300, 40.0, 45.0)
    load = np.where(t < 420, 0.0, 2.5)
    pv = process_output(PROCESS, t, op + load) + np.random.default_rng(2).normal(0, 0.1, t.size)
    record = Record(t=t, pv=pv, op=op)
    model = identified(record)
    case = tune(record)
    assert model.process is None or case.best is not None
    for best in () if case.best is None else (case.best,):
        assert best.proposal.pid is not None
        assert margins(PROCESS, best.proposal.pid).Ms < 3.0


def test_a_clean_step_test_has_no_other_reading() -> None:
    t = np.arange(900.0)
    op = np.where(t < 300, 40.0, 45.0)
    pv = process_output(PROCESS, t, op) + np.random.default_rng(3).normal(0.0, 0.05, t.size)
    record = Record(t=t, pv=pv, op=op)
    model = identified(record)
    assert model.verdict is Verdict.TRUSTED
    found = rivals(record, model)
    assert found is not None
    assert found.notes == ()
    assert found.processes.shape == (201,)


def test_draws_of_two_lags_keep_both() -> None:
    t = np.arange(1500.0)
    op = np.where(t < 300, 40.0, 45.0) - np.where(t < 900, 0.0, 5.0)
    process = SOPDT(K=2.0, tau1=60.0, tau2=40.0, theta=5.0)
    pv = process_output(process, t, op) + np.random.default_rng(4).normal(0.0, 0.02, t.size)
    record = Record(t=t, pv=pv, op=op)
    model = identified(record)
    assert isinstance(model.process, SOPDT)
    found = rivals(record, model)
    assert found is not None
    assert found.processes.tau2.min() > 0


def test_a_whitened_fit_that_calls_for_other_settings_is_taken_into_account() -> None:
    t = np.arange(900.0)
    op = np.where(t < 300, 40.0, 45.0)
    pv = process_output(PROCESS, t, op) + np.random.default_rng(3).normal(0.0, 0.05, t.size)
    record = Record(t=t, pv=pv, op=op)
    model = identified(record)
    for other in (FOPDT(K=2.0, tau=30.0, theta=1.0), IPDT(K=0.1, theta=10.0)):
        found = rivals(record, replace(model, process=other))
        assert found is not None
        assert any("wandering disturbance" in note for note in found.notes)
        assert found.processes.tau1[-1] == pytest.approx(60.0, rel=0.05)


def test_without_known_errors_the_model_stands_alone() -> None:
    t = np.arange(900.0)
    op = np.where(t < 300, 40.0, 45.0)
    pv = process_output(PROCESS, t, op) + np.random.default_rng(3).normal(0.0, 0.05, t.size)
    record = Record(t=t, pv=pv, op=op)
    model = replace(identified(record), choice=None, standard_errors=None)
    found = rivals(record, model)
    assert found is not None
    assert found.processes.shape == (1,)
    assert rivals(record, replace(model, process=DoubleIntegrator(K=1.0, theta=1.0))) is None
    assert rivals(record, replace(model, process=None)) is None


def test_uneven_samples_are_not_fitted_again() -> None:
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.exponential(1.0, 900))
    op = np.where(t < 300, 40.0, 45.0)
    pv = process_output(PROCESS, t, op) + rng.normal(0.0, 0.05, t.size)
    record = Record(t=t, pv=pv, op=op)
    found = rivals(record, identified(record))
    assert found is not None
    assert not any("wandering disturbance" in note for note in found.notes)
