"""The PI of least variance: by simulation, by brute force, and where it must refuse."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.margin_batch import batch_margins
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, Process, PureDelay, TransferFunction
from loop.signals import Real
from loop.simulation import simulate
from loop.simulation_batch import simulate_batch
from monitoring.achievable_variance import AchievableVariance, achievable_variance
from monitoring.basis import Confidence
from monitoring.known_loop import KnownLoop
from monitoring.loop_signals import Stretch

N = 8000
SELF_REGULATING = FOPDT(K=2.0, tau=20.0, theta=5.0)
CALM = PID(Kc=0.5, Ti=20.0)


def course(seed: int, kind: str = "walk") -> tuple[Real, Real]:
    """Set point with small moves, and a walking or a coloured disturbance."""
    rng = np.random.default_rng(seed)
    white = rng.normal(size=N)
    walk = 0.05 * np.cumsum(white) + 0.02 * rng.normal(size=N)
    lagged = lfilter([1.0], [1.0, -0.98], 0.2 * white)
    d = walk if kind == "walk" else lagged
    return np.where((np.arange(N) // 1500) % 2 == 1, 0.5, 0.0), d - d[0]


def recorded(process: Process, pid: PID, sp: Real, d: Real) -> Stretch:
    run = simulate(process, pid, t_end=N - 1.0, dt=1.0, sp=sp, output_load=d)
    return Stretch(first=0, dt=1.0, pv=run.pv, op=run.op, sp=run.sp, share=1.0)


@pytest.mark.parametrize(
    ("process", "pid"),
    [
        (SELF_REGULATING, CALM),
        (FOPDT(K=1.0, tau=2.0, theta=15.5), PID(Kc=0.2, Ti=10.0)),
        (IPDT(K=0.02, theta=6.0), PID(Kc=2.0, Ti=80.0)),
        (SOPDT(K=1.0, tau1=30.0, tau2=10.0, theta=4.0), PID(Kc=0.5, Ti=60.0, Td=5.0)),
        (TransferFunction((1.0,), (300.0, 40.0, 1.0), 4.0), PID(Kc=0.5, Ti=60.0)),
    ],
)
@pytest.mark.parametrize(("derivative", "kind"), [(False, "walk"), (True, "lag")])
def test_the_loop_simulated_with_those_settings_has_that_variance(
    process: Process, pid: PID, derivative: bool, kind: str
) -> None:
    sp, d = course(1, kind)
    known = KnownLoop(process=process, controller=pid)
    found = achievable_variance(recorded(process, pid, sp, d), known, derivative=derivative)
    assert found.Kc is not None
    assert found.Ti is not None
    assert found.Td is not None
    best = PID(Kc=found.Kc, Ti=found.Ti, Td=found.Td)
    rerun = recorded(process, best, sp, d)
    assert found.achievable == pytest.approx(np.var(rerun.error), rel=0.06)
    # the continuous margins, hold as half a scan, see the same peak as the scans do
    assert found.Ms == pytest.approx(margins(process, best, sample_time=1.0).Ms, rel=0.08)
    assert found.Ms is not None
    assert found.Ms <= 2.0
    # the settings that ran give back the variance that there was
    assert found.stated_over_actual == pytest.approx(1.0, abs=0.08)
    assert found.index is not None
    assert found.low is not None
    assert found.low < found.index < 1.05
    assert (found.Td > 0) <= derivative


@pytest.mark.parametrize("process", [SELF_REGULATING, IPDT(K=0.02, theta=6.0)])
def test_no_pi_of_a_brute_force_grid_does_better(process: FOPDT | IPDT) -> None:
    sp, d = course(2)
    pid = PID(Kc=1.0, Ti=60.0)
    found = achievable_variance(recorded(process, pid, sp, d), KnownLoop(process=process), Ms=1.7)
    assert found.achievable is not None
    Kc, Ti = np.meshgrid(np.geomspace(0.2, 5.0, 14), np.geomspace(8.0, 400.0, 11))
    grid = PIDBatch(Kc=Kc.ravel(), Ti=Ti.ravel())
    fit = batch_margins(ProcessBatch.of(process), grid, sample_time=1.0)
    allowed = fit.stable & (fit.Ms <= 1.7)
    assert 20 < np.count_nonzero(allowed) < allowed.size
    some = PIDBatch(Kc=grid.Kc[allowed], Ti=grid.Ti[allowed])
    runs = simulate_batch([process], some, t_end=N - 1.0, dt=1.0, sp=sp, output_load=d)
    least = float(np.var(runs.sp[:, None] - runs.pv, axis=0).min())
    # 3 % for the spectrum's sampling error, 10 % for the grid's own width
    assert 0.97 * found.achievable < least < 1.10 * found.achievable


def test_the_index_forgets_which_controller_ran() -> None:
    sp, d = course(3)
    slow, quick = (
        achievable_variance(
            recorded(SELF_REGULATING, pid, sp, d), KnownLoop(process=SELF_REGULATING)
        )
        for pid in (PID(Kc=0.2, Ti=30.0), PID(Kc=1.2, Ti=25.0))
    )
    assert slow.achievable == pytest.approx(quick.achievable, rel=0.05)
    assert slow.index is not None
    assert quick.index is not None
    assert slow.index < 0.4 < 0.85 < quick.index
    assert slow.stated_over_actual is None
    # segments of an odd number of samples have no frequency of their own at half a turn a sample
    whole = recorded(SELF_REGULATING, PID(Kc=0.2, Ti=30.0), sp, d)
    part = replace(whole, pv=whole.pv[:4500], op=whole.op[:4500], sp=sp[:4500])
    odd = achievable_variance(part, KnownLoop(process=SELF_REGULATING))
    assert odd.index == pytest.approx(slow.index, rel=0.5)


def test_the_interval_covers_what_a_long_record_says() -> None:
    known = KnownLoop(process=SELF_REGULATING)

    def index(n: int, seed: int) -> AchievableVariance:
        white = np.random.default_rng(seed).normal(size=n)
        d = lfilter([1.0], [1.0, -0.98], 0.2 * white)
        run = simulate(SELF_REGULATING, CALM, t_end=n - 1.0, dt=1.0, output_load=d)
        return achievable_variance(
            Stretch(first=0, dt=1.0, pv=run.pv, op=run.op, sp=run.sp, share=1.0), known
        )

    truth = index(60_000, 999).index
    found = [index(6000, seed) for seed in range(12)]
    inside = [one.low < truth < one.high for one in found]  # type: ignore[operator]
    assert sum(inside) >= 11  # 95 % of 12; the interval is a wide one
    assert np.mean([one.index for one in found]) == pytest.approx(truth, rel=0.08)


def test_a_wished_pace_leaves_only_calmer_loops() -> None:
    sp, d = course(4)
    stretch = recorded(SELF_REGULATING, CALM, sp, d)
    known = KnownLoop(process=SELF_REGULATING)
    free, wished = (achievable_variance(stretch, known, tau_c=tau_c) for tau_c in (None, 15.0))
    assert free.achievable is not None
    assert wished.achievable is not None
    assert wished.achievable > 1.2 * free.achievable
    assert wished.Kc is not None
    assert wished.Ti is not None
    # |L| = 1 at 1/(tau_c + theta), the wish
    w = 1 / 20
    P = 2.0 / (1 + 20j * w)
    assert abs(P * wished.Kc * (1 + 1 / (1j * w * wished.Ti))) == pytest.approx(1.0, rel=0.05)


def test_stated_settings_that_did_not_run_are_told_so() -> None:
    sp, d = course(5)
    stretch = recorded(SELF_REGULATING, PID(Kc=1.2, Ti=20.0), sp, d)
    stated = PID(Kc=0.4, Ti=20.0)
    found = achievable_variance(stretch, KnownLoop(process=SELF_REGULATING, controller=stated))
    with_those = np.var(recorded(SELF_REGULATING, stated, sp, d).error) / np.var(stretch.error)
    assert found.stated_over_actual == pytest.approx(with_those, rel=0.1)
    assert any("others ran" in reason for reason in found.basis.reasons)
    assert found.basis.confidence is Confidence.MEDIUM


def test_a_loop_tighter_than_the_limit_is_told_so_and_marks_are_kept() -> None:
    sp, d = course(6)
    stretch = recorded(SELF_REGULATING, PID(Kc=1.6, Ti=12.0, Td=2.0), sp, d)
    known = KnownLoop(process=SELF_REGULATING)
    found = achievable_variance(stretch, known, Ms=1.2, marks=("the valve sticks",))
    assert any("the loop is tighter" in reason for reason in found.basis.reasons)
    assert not found.comparable
    assert "the valve sticks" in found.basis.reasons


def test_what_cannot_be_judged_says_why() -> None:
    sp, d = course(7)
    stretch = recorded(SELF_REGULATING, CALM, sp, d)
    flat = replace(stretch, op=np.zeros(N))
    short = replace(stretch, pv=stretch.pv[:300], op=stretch.op[:300], sp=None)
    unstable = TransferFunction((1.0,), (10.0, -1.0))
    for data, process, why in (
        (stretch, unstable, "unstable by itself"),
        (stretch, FOPDT(K=1.0, tau=0.5, theta=0.2), "too fast for samples"),
        (stretch, FOPDT(K=1.0, tau=900.0, theta=0.2), "fewer than the"),
        (short, SELF_REGULATING, "300 samples are fewer than the 1000 needed"),
        (flat, SELF_REGULATING, "does not move"),
    ):
        found = achievable_variance(data, KnownLoop(process=process))
        assert found.basis.refused
        assert why in found.basis.reasons[0]
        assert found.index is found.achievable is None
    # no loop around a long dead time is calmer than that
    late = PureDelay(K=1.0, theta=30.0)
    found = achievable_variance(stretch, KnownLoop(process=late), Ms=1.0001)
    assert found.basis.refused
    assert "no PI is stable within" in found.basis.reasons[0]
    for bad in ({"Ms": 1.0}, {"tau_c": 0.0}):
        with pytest.raises(ValueError, match="must be"):
            achievable_variance(stretch, KnownLoop(process=late), **bad)


def test_what_is_known_of_a_loop_is_checked() -> None:
    with pytest.raises(ValueError, match="scan_time must be positive"):
        KnownLoop(process=SELF_REGULATING, scan_time=0.0)
    with pytest.raises(ValueError, match="uncertainty must lie"):
        KnownLoop(process=SELF_REGULATING, uncertainty=1.0)
    assert KnownLoop(process=PureDelay(K=1.0, theta=4.0)).pace == 4.0
    assert not KnownLoop(process=IPDT(K=1.0, theta=4.0)).unstable
