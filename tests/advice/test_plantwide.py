"""The list of suspects from the records of several loops."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.signal import lfilter

from advice.plantwide import plant_oscillations
from loop.record import Record
from loop.signals import Real

START = datetime(2026, 1, 31, tzinfo=UTC)
N = 900


def record(tag: str, error: Real, *, late: float = 0.0, op: Real | None = None) -> Record:
    n = error.size
    return Record(
        t=np.arange(n) * 10.0, pv=50.0 - error, sp=np.full(n, 50.0),
        op=np.full(n, 40.0) if op is None else op, start=START + timedelta(seconds=late), tag=tag,
    )  # fmt: skip


def chain(seed: int = 5) -> list[Record]:
    """A valve sticks in FIC-1; two loops downstream get it through their lags."""
    rng = np.random.default_rng(seed)
    phase = np.cumsum((1 + 0.1 * rng.normal(size=N)) / 36.0)
    valve = np.sign(np.sin(2 * np.pi * phase)) + 0.1 * rng.normal(size=N)

    def through(tau: float) -> Real:
        a = np.exp(-1 / tau)
        once = lfilter([1 - a], [1.0, -a], valve)
        return np.asarray(lfilter([1 - a], [1.0, -a], once)) + 0.02 * rng.normal(size=N)

    return [record("TIC-2", through(6.0)), record("FIC-1", valve), record("LIC-3", through(9.0))]


def test_the_sticking_loop_is_named_and_the_loops_it_drags_along() -> None:
    found = plant_oscillations([*chain(), record("PIC-9", np.random.default_rng(1).normal(size=N))])
    (group,) = found.groups

    assert {one.tag for one in group.suspects} == {"FIC-1", "TIC-2", "LIC-3"}
    assert group.source == "FIC-1"
    assert "Check its valve first" in group.reason
    assert group.period == pytest.approx(360.0, rel=0.05)
    assert found.left_out == ()


def test_the_order_in_which_loops_are_given_changes_nothing() -> None:
    one = plant_oscillations(chain()).groups[0]
    other = plant_oscillations(chain()[::-1]).groups[0]
    assert one.source == other.source
    assert one.period == pytest.approx(other.period)
    assert one.suspects == other.suspects


def test_a_disturbance_that_all_loops_share_has_no_source_among_them() -> None:
    rng = np.random.default_rng(2)
    w, r = 2 * np.pi / 30, 0.998
    outside = lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], rng.normal(size=N))
    found = plant_oscillations(
        [record("A", outside), record("B", 3 * outside + rng.normal(size=N) * 0.1)]
    )
    (group,) = found.groups
    assert group.source is None
    assert "a disturbance from outside" in group.reason


def test_loops_are_laid_over_each_other_by_the_clock() -> None:
    first, *others = chain()
    late = [record(one.tag, (50.0 - one.pv)[20:], late=200.0) for one in others]
    (group,) = plant_oscillations([first, *late]).groups
    assert group.source == "FIC-1"


def test_a_cascade_is_recognised() -> None:
    rng = np.random.default_rng(3)
    out = 50 + np.cumsum(rng.normal(size=N))
    outer = record("TIC-1", rng.normal(size=N), op=out)
    inner = Record(
        t=np.arange(N) * 10.0, pv=out + rng.normal(size=N), sp=out, op=np.full(N, 3.0), start=START,
        tag="FIC-1",
    )  # fmt: skip
    (pair,) = plant_oscillations([outer, inner]).cascades
    assert (pair.outer, pair.inner) == ("TIC-1", "FIC-1")


def test_what_cannot_be_looked_at_is_named_with_the_reason() -> None:
    short = record("SHORT", np.ones(10))
    holes = np.random.default_rng(4).normal(size=N)
    holes[200:600] = np.nan
    found = plant_oscillations([short, record("HOLES", holes), *chain()])
    assert dict(found.left_out) == {
        "SHORT": "10 samples are fewer than 64",
        "HOLES": "no set point, or gaps that are too long",
    }
    elsewhere = record("A", np.ones(N)), record("B", np.ones(N), late=1e6)
    assert plant_oscillations(elsewhere).left_out[0][1] == "no time in common with the others"
    assert plant_oscillations([]).groups == ()


def test_a_loop_given_twice_or_without_a_clock_is_refused() -> None:
    one, *_ = chain()
    with pytest.raises(ValueError, match="every loop may be given once"):
        plant_oscillations([one, one])
    bare = [Record(t=one.t, pv=one.pv, op=one.op, sp=one.sp, tag=tag) for tag in "AB"]
    with pytest.raises(ValueError, match="every record needs its start"):
        plant_oscillations(bare)


def test_bursts_months_apart_are_left_out_and_not_put_on_a_grid_of_microseconds() -> None:
    burst = np.arange(100) * 1e-6
    t = np.r_[burst, burst + 2e6]
    bursts = [
        Record(t=t, pv=np.zeros(200), op=np.zeros(200), sp=np.zeros(200), start=START, tag=tag)
        for tag in ("A", "B")
    ]
    found = plant_oscillations(bursts)
    assert found.groups == ()
    assert found.left_out == (("A", "samples far too uneven"), ("B", "samples far too uneven"))
