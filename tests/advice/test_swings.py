"""Which loops belong to a swing, and what is looked at in them."""

import numpy as np

from advice.swings import Grid, swings_of
from loop.controller import PID
from loop.process import FOPDT
from loop.signals import Codes, Real
from loop.simulation import simulate
from loop.valve import Kano

N = 900


def grid(*rows: tuple[Real, Real, Real], mode: tuple[Codes | None, ...] | None = None) -> Grid:
    """Loops by error, PV and OP."""
    error, pv, op = (np.array(part) for part in zip(*rows, strict=True))
    return Grid(
        dt=1.0, error=error, pv=pv, op=op, mode=mode or (None,) * len(rows),
        levels=(False,) * len(rows),
    )  # fmt: skip


def still(row: Real) -> tuple[Real, Real, Real]:
    return row, -row, np.zeros(row.size)


def wave(rng: np.random.Generator) -> Real:
    return np.sin(2 * np.pi * np.cumsum(1 + 0.15 * rng.normal(size=N)) / 25)


def test_loops_that_only_feel_the_swing_belong_to_it_by_error_or_pv() -> None:
    rng = np.random.default_rng(1)
    cause = wave(rng)
    late = np.roll(cause, 4)
    behind = 3 * rng.normal(size=N)  # a set point that noise moves hides the swing in the error
    (swing,) = swings_of(
        grid(
            still(cause + 0.1 * rng.normal(size=N)),
            still(0.5 * late + rng.normal(size=N)),
            (behind - late, late + 0.1 * rng.normal(size=N), np.zeros(N)),
            still(rng.normal(size=N)),
        )
    )
    assert swing.members == (0, 1, 2)
    assert swing.own[0]
    assert not swing.own[2]
    assert swing.coherence[2] > 0.8
    assert all(one.stiction is None for one in swing.loops)


def test_two_loops_on_one_transmitter_do_not_take_each_others_arrows_away() -> None:
    rng = np.random.default_rng(2)
    cause = wave(rng) + 0.3 * rng.normal(size=N)
    effect = np.convolve(cause, [0, 0, 0.5, 0.3, 0.2])[:N] + 0.2 * rng.normal(size=N)
    (swing,) = swings_of(grid(still(cause), still(-2 * cause), still(effect)))
    assert swing.arrows.drives(0, 2)
    assert swing.arrows.drives(1, 2)
    assert not swing.arrows.drives(0, 1)


def test_loops_that_share_nothing_have_no_swing() -> None:
    rng = np.random.default_rng(3)
    assert swings_of(grid(still(wave(rng)), still(rng.normal(size=N)))) == ()


def test_the_valve_is_judged_where_op_moves_in_automatic() -> None:
    run = simulate(
        FOPDT(K=1.0, tau=10.0, theta=2.0), PID(Kc=1.2, Ti=8.0), t_end=N + 99.0, dt=1.0, sp=1.0,
        valve=Kano(S=6.0, J=4.0), noise=0.05, rng=np.random.default_rng(4),
    )  # fmt: skip
    keep = slice(100, None)
    own = (run.sp[keep] - run.pv[keep], run.pv[keep], run.op[keep])
    victim = still(np.convolve(own[0], np.ones(4) / 4)[: own[0].size])
    manual = np.zeros(own[0].size, np.int8)
    (swing,) = swings_of(grid(own, victim))
    assert swing.loops[0].stiction is not None
    assert swing.loops[0].stiction > 0.5
    assert swing.loops[1].stiction is None
    (hand,) = swings_of(grid(own, victim, mode=(manual, None)))
    assert hand.loops[0].stiction is None
