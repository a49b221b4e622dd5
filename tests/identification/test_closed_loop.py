"""Routine data of a loop in automatic: models within their errors, or refusals with numbers."""

import numpy as np
import pytest

from identification.closed_loop import identify_routine, is_routine
from identification.even_record import even_record
from identification.even_stretches import Stretch, thinned
from identification.identify import Identification
from identification.informative_segments import Excitation, find_segments
from identification.prediction_error import prediction_error_fit
from identification.verdict import Verdict
from identification.whitened_search import lag_samples
from loop.controller import PID, Action
from loop.errors import PoorExcitation
from loop.open_loop import process_output
from loop.process import FOPDT, SOPDT
from loop.record import Mode, Record
from loop.signals import Real
from loop.simulation import simulate

HEATER = FOPDT(K=1.0, tau=50.0, theta=15.0)
SETTINGS = PID(Kc=1.6, Ti=50.0)


def drift(n: int, *, size: float, memory: float, seed: int) -> Real:
    """First-order coloured noise of a standard deviation `size`."""
    keep = np.exp(-1 / memory)
    pushes = np.random.default_rng(seed).normal(0.0, size * np.sqrt(1 - keep**2), n)
    level = np.zeros(n)
    for k in range(1, n):
        level[k] = keep * level[k - 1] + pushes[k]
    return level


def routine(
    seed: int,
    *,
    process: FOPDT = HEATER,
    settings: PID = SETTINGS,
    moves: int = 4,
    noise: float = 0.03,
    load: float = 0.0,
    n: int = 3600,
) -> Record:
    """An hour in automatic: set-point moves of 1 PV, noise, a wandering load."""
    t = np.arange(n) * 1.0
    edges = np.linspace(0, n, moves + 2)[1:-1]
    sp = 40.0 + np.searchsorted(edges, t, side="right") % 2
    run = simulate(
        process,
        settings,
        t_end=n - 0.5,
        dt=1.0,
        sp=sp,
        load=drift(n, size=load, memory=200.0, seed=seed),
        noise=noise,
        rng=np.random.default_rng(seed),
        pv0=40.0,
        op0=50.0,
    )
    return Record(
        t=run.t, sp=run.sp, pv=run.pv, op=run.op, mode=np.full(n, Mode.AUTO, dtype=np.int8)
    )


def test_held_samples_agree_with_the_exact_answer_of_the_process() -> None:
    op = np.random.default_rng(3).normal(size=200)
    t = np.arange(200) * 2.0
    for tau, theta in ((7.0, 0.0), (7.0, 3.3), (0.8, 11.9)):
        exact = process_output(FOPDT(K=1.0, tau=tau, theta=theta), t, op)
        assert lag_samples(op, 2.0, tau, theta) == pytest.approx(exact, abs=1e-12)


def test_a_dead_time_longer_than_the_record_lets_nothing_arrive() -> None:
    assert not np.any(lag_samples(np.arange(10.0), 1.0, 5.0, 30.0))


def test_without_noise_the_process_comes_back_exactly() -> None:
    record = routine(1, noise=0.0, n=1000, process=FOPDT(K=-0.7, tau=31.7, theta=8.3),
                     settings=PID(Kc=1.5, Ti=40.0, action=Action.DIRECT))  # fmt: skip
    stretch = Stretch(pv=record.pv, op=record.op)
    fit = prediction_error_fit((stretch,), 1.0, slowest=1000.0, latest=100.0)
    assert (fit.K, fit.tau, fit.theta) == pytest.approx((-0.7, 31.7, 8.3), rel=1e-4)


def test_errors_are_as_large_as_stated_where_the_disturbance_is_white() -> None:
    found = [identify_routine(routine(seed, noise=0.1)) for seed in range(8)]
    off = np.array([_off(f) for f in found])
    # Chi-squared of 24: between 7.5 and 51.2 in 998 of 1000.
    assert 7.5 < float(np.sum(off**2)) < 51.2


def test_a_wandering_load_which_the_output_answers_does_not_turn_the_model() -> None:
    for seed in range(4):
        found = identify_routine(routine(seed, load=0.1))
        assert isinstance(found.fitted, FOPDT)
        assert pytest.approx(1.0, rel=0.2) == found.fitted.K
        assert found.fitted.tau == pytest.approx(50.0, rel=0.2)
        assert found.fitted.theta == pytest.approx(15.0, rel=0.1)


def _off(found: Identification) -> Real:
    """Errors of K, tau, theta in their standard errors."""
    assert isinstance(found.fitted, FOPDT)
    assert found.standard_errors is not None
    fitted = np.array([found.fitted.K, found.fitted.tau, found.fitted.theta])
    return (fitted - [HEATER.K, HEATER.tau, HEATER.theta]) / found.standard_errors


def test_feedback_from_noise_alone_is_refused_with_what_is_missing() -> None:
    found = identify_routine(routine(1, moves=0, load=0.3))
    assert found.verdict is Verdict.REFUSED
    assert found.process is None
    assert "the set point stood still" in found.reasons[0]
    assert "Move the set point by at least" in found.reasons[0]


def test_moves_within_the_wander_are_refused_with_their_size() -> None:
    found = identify_routine(routine(1, noise=2.0))
    assert found.verdict is Verdict.REFUSED
    assert "where PV wanders by" in found.reasons[0]


def test_a_set_point_move_gives_a_model_that_may_be_used() -> None:
    found = identify_routine(routine(2, moves=3))
    assert found.verdict is Verdict.TRUSTED
    assert found.process is not None
    assert found.process.theta == pytest.approx(15.0, abs=1.0)
    assert found.reasons[-1].startswith("Fitted in closed loop")


def test_segments_are_found_with_their_moves_and_gaps_left_out() -> None:
    record = routine(1, moves=2)
    pv = record.pv.copy()
    pv[600:640] = np.nan
    search = find_segments(even_record(Record(t=record.t, sp=record.sp, pv=pv, op=record.op)))
    assert [m.kind for m in search.moves] == [Excitation.SET_POINT] * 2
    assert [m.first for m in search.moves] == [1200, 2400]
    assert all(s.first > 640 or s.last <= 600 for s in search.segments)


def test_averages_of_neighbours_start_where_their_output_does() -> None:
    (thin,) = thinned([Stretch(pv=np.arange(6.0), op=np.arange(8.0), lead=2)], 2)
    assert thin.lead == 1
    assert thin.pv.tolist() == [0.5, 2.5, 4.5]
    assert thin.op.tolist() == [0.5, 2.5, 4.5, 6.5]


def test_a_record_without_a_set_point_and_without_a_mode_is_not_routine_data() -> None:
    t = np.arange(100.0)
    assert not is_routine(Record(t=t, pv=t, op=t))
    assert is_routine(Record(t=t, pv=t, op=t, sp=t))
    assert not is_routine(Record(t=t, pv=t, op=t, mode=np.zeros(100, dtype=np.int8)))


@pytest.mark.parametrize("what", ["few", "uneven", "huge", "pv stands", "op stands", "no sp"])
def test_bad_records_are_refused_in_words(what: str) -> None:
    record = routine(1, n=400, moves=1)
    t, sp, pv, op = (np.array(x) for x in (record.t, record.sp, record.pv, record.op))
    if what == "few":
        t, sp, pv, op = t[:20], sp[:20], pv[:20], op[:20]
    elif what == "uneven":
        t = np.cumsum(np.random.default_rng(1).exponential(1.0, 400)) + 1e-6 * t
    elif what == "huge":
        pv[5] = 1e13
    elif what == "pv stands":
        pv[:] = 40.0
    elif what == "op stands":
        op[:] = 50.0
    else:
        sp[:] = np.nan
    found = identify_routine(Record(t=t, sp=sp, pv=pv, op=op))
    assert found.verdict is Verdict.REFUSED
    assert found.process is None
    assert found.reasons[0].endswith(".")


def test_stretches_of_different_lengths_are_an_error() -> None:
    with pytest.raises(ValueError, match="need 3 of OP, got 2"):
        Stretch(pv=np.zeros(2), op=np.zeros(2), lead=1)


def test_a_record_without_any_set_point_says_so() -> None:
    record = routine(1, n=400)
    even = even_record(Record(t=record.t, pv=record.pv, op=record.op, mode=record.mode))
    with pytest.raises(PoorExcitation, match="Export the set point too"):
        find_segments(even)


def test_moves_in_manual_and_the_switch_to_automatic_are_moves_too() -> None:
    t = np.arange(2400.0)
    op = np.where((t >= 300) & (t < 700), 53.0, 50.0)
    manual = t < 1200
    pv = process_output(HEATER, t[:1200], op[:1200], pv0=40.0)
    run = simulate(
        HEATER, SETTINGS, t_end=1199.5, dt=1.0, sp=43.0, pv0=40.0, op0=50.0,
        noise=0.05, rng=np.random.default_rng(5),
    )  # fmt: skip
    noise = np.random.default_rng(6).normal(0.0, 0.05, 1200)
    record = Record(
        t=t,
        sp=np.full(t.size, 43.0),
        pv=np.concatenate((pv + noise, run.pv)),
        op=np.concatenate((op[:1200], run.op)),
        mode=np.where(manual, Mode.MAN, Mode.AUTO).astype(np.int8),
    )
    search = find_segments(even_record(record))
    assert [(m.kind, m.first) for m in search.moves] == [
        (Excitation.OUTPUT, 300),
        (Excitation.OUTPUT, 700),
        (Excitation.SWITCH, 1200),
    ]
    found = identify_routine(record)
    assert isinstance(found.process, FOPDT)
    assert found.process.theta == pytest.approx(15.0, abs=1.0)
    assert "2 output move in manual, 1 switch" in found.reasons[-1]


def test_a_set_point_that_goes_there_and_back_at_once_counts_by_its_reach() -> None:
    record = routine(1, moves=0, n=1200)
    assert record.sp is not None
    sp = np.where((record.t >= 600) & (record.t < 603), 42.0, record.sp)
    (move,) = find_segments(even_record(_with_set_point(record, sp))).moves
    assert (move.first, move.size) == (600, 2.0)


def test_gaps_right_after_every_move_leave_nothing() -> None:
    record = routine(1, moves=1, n=1200)
    pv = np.where((record.t > 610) & (record.t < 900), np.nan, record.pv)
    found = identify_routine(Record(t=record.t, sp=record.sp, pv=pv, op=record.op))
    assert "fewer than 30 rows after every one of 1 moves" in found.reasons[0]


def test_two_equal_lags_almost_without_noise_are_refused_rather_than_misread() -> None:
    t = np.arange(3000.0)
    sp = 40.0 + 5.0 * (t // 500 % 2)
    run = simulate(
        SOPDT(K=1.0, tau1=40.0, tau2=30.0, theta=5.0), PID(Kc=1.5, Ti=60.0), t_end=2999.5, dt=1.0,
        sp=sp, noise=0.01, rng=np.random.default_rng(1), pv0=40.0, op0=50.0,
    )  # fmt: skip
    found = identify_routine(Record(t=run.t, sp=run.sp, pv=run.pv, op=run.op))
    assert any("not quite first order" in reason for reason in found.reasons)
    assert found.verdict is Verdict.REFUSED


def test_a_gain_that_no_process_has_is_refused() -> None:
    record = routine(1, moves=2, n=1200)
    assert record.sp is not None
    tiny = Record(t=record.t, sp=1e-12 * record.sp, pv=1e-12 * record.pv, op=record.op)
    found = identify_routine(tiny)
    assert found.process is None
    assert found.reasons[0].startswith("K must lie within")


@pytest.mark.parametrize(
    ("keep", "what"),
    [(60, "samples every 60 s"), (20, "samples every 20 s")],
)
def test_coarse_samples_cost_the_verdict(keep: int, what: str) -> None:
    record = routine(1, moves=6, n=10_000)
    assert record.sp is not None
    thin = Record(
        t=record.t[::keep], sp=record.sp[::keep], pv=record.pv[::keep], op=record.op[::keep]
    )
    found = identify_routine(thin)
    assert found.verdict is not Verdict.TRUSTED
    assert any(what in reason.lower() for reason in found.reasons)


def test_a_short_record_of_a_slow_process_leaves_its_parameters_open() -> None:
    slow = FOPDT(K=1.0, tau=4000.0, theta=15.0)
    found = identify_routine(
        routine(3, process=slow, settings=PID(Kc=20.0, Ti=300.0), moves=1, n=500, noise=0.05)
    )
    assert found.verdict is not Verdict.TRUSTED


def _with_set_point(record: Record, sp: Real) -> Record:
    return Record(t=record.t, sp=sp, pv=record.pv, op=record.op, mode=record.mode)
