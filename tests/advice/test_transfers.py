"""Transfer entropy as evidence beside the ranking of a group."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from advice.swings import Grid, Swing, swings_of, thinning
from advice.transfers import Transfer, doubt_of_entropy, told_by_entropy, transfers_of
from monitoring.origin import Origin

TAGS = ("A", "B", "C")
# Two samples are averaged to one.
PERIOD, N, LATE = 50.0, 1600, 6


@pytest.fixture(scope="module")
def swing() -> Swing:
    """A loop that swings, driven by noise, and one that follows it by six samples."""
    rng = np.random.default_rng(4)
    a = [1.0, -2 * 0.99 * np.cos(2 * np.pi / PERIOD), 0.99**2]
    wave = np.asarray(lfilter([1.0], a, rng.normal(size=N + 600)))[600:]
    wave /= float(np.std(wave))
    late = np.roll(wave, LATE) + 0.1 * rng.normal(size=N)
    error = np.array([wave, late])
    grid = Grid(
        dt=5.0, error=error, pv=-error, op=np.zeros((2, N)), mode=(None,) * 2, levels=(False,) * 2
    )
    (found,) = swings_of(grid)
    return found


@pytest.fixture(scope="module")
def transfers(swing: Swing) -> tuple[Transfer, ...]:
    return transfers_of(swing)


def test_the_source_tells_the_follower_after_the_delay_between_them(
    swing: Swing, transfers: tuple[Transfer, ...]
) -> None:
    assert thinning(swing.period) == 2
    there, back = transfers
    assert (there.cause, there.effect) == (0, 1)
    assert (back.cause, back.effect) == (1, 0)
    assert there.found.significant
    assert there.delay == pytest.approx(LATE, abs=2)
    assert not back.found.significant


def test_what_is_told_is_said_of_the_loop_that_tells_it(transfers: tuple[Transfer, ...]) -> None:
    said = told_by_entropy(transfers, 0, TAGS, 5.0)
    assert said.startswith("by transfer entropy it tells B ")
    assert said.endswith(" s")
    assert told_by_entropy(transfers, 1, TAGS, 5.0) == ""
    assert doubt_of_entropy(transfers) == ""


def test_of_many_loops_nothing_is_measured_and_of_short_records_the_reason_is_given(
    swing: Swing,
) -> None:
    assert transfers_of(replace(swing, compared=(0, 1, 2, 3, 4))) == ()
    assert doubt_of_entropy(()) == ""
    short = transfers_of(replace(swing, signals=swing.signals[:, :100]))
    assert doubt_of_entropy(short) == (
        "Transfer entropy was not measured: 100 samples are fewer than 212."
    )


def test_only_the_two_nearest_rivals_of_the_likeliest_source_are_compared(swing: Swing) -> None:
    rows = np.random.default_rng(5).normal(size=(4, 250))
    found = transfers_of(
        replace(
            swing, compared=(0, 2, 3, 5), signals=rows,
            origin=Origin(
                probabilities=(0.1, 0.0, 0.6, 0.05, 0.0, 0.2), elsewhere=0.05, named=None
            ),
        )
    )  # fmt: skip
    assert [(one.cause, one.effect) for one in found] == [(2, 5), (5, 2), (2, 0), (0, 2)]
