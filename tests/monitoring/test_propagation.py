"""Delays between loops that swing, and whether loops keep step at all."""

import numpy as np
import pytest
from scipy import signal
from scipy.signal import lfilter

from loop.signals import Real
from monitoring.phase_locking import phase_locking
from monitoring.propagation import propagation

N, PERIOD = 2400, 40.0


def swing(rng: np.random.Generator, *, cycles: float = 2.0, period: float = PERIOD) -> Real:
    """A swing that wanders within so many cycles."""
    w, r = 2 * np.pi / period, np.exp(-1 / (cycles * period))
    wave = lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], rng.normal(size=N + 1000))[1000:]
    return np.asarray(wave / np.std(wave))


@pytest.mark.parametrize(("late", "sign"), [(7, 1), (13, -1), (-25, 1), (0, -1)])
def test_the_delay_of_a_swing_that_wanders_is_found_with_its_sign(late: int, sign: int) -> None:
    rng = np.random.default_rng(1)
    first = swing(rng)
    noise = 0.3 * rng.normal(size=(2, N))
    (found,) = propagation(np.array([first, sign * np.roll(first, late)]) + noise, PERIOD)
    assert found.clear
    assert found.sign == sign
    assert abs(found.delay - late) < max(4 * found.error, 0.1)
    assert found.error < 0.5


def test_a_wave_that_never_changes_leaves_whole_periods_open() -> None:
    t = np.arange(N)
    rng = np.random.default_rng(2)
    pair = np.array([np.sin(2 * np.pi * (t - late) / PERIOD) for late in (0, 10)])
    (found,) = propagation(pair + 0.1 * rng.normal(size=pair.shape), PERIOD)
    assert not found.clear
    # Half a period away with the other sign is as good, a whole one with the same.
    away = abs(found.delay - found.rival) % (PERIOD / 2)
    assert min(away, PERIOD / 2 - away) < 1.0
    assert (found.delay - 10) % (PERIOD / 2) == pytest.approx(0, abs=0.5) or (found.delay - 10) % (
        PERIOD / 2
    ) == pytest.approx(PERIOD / 2, abs=0.5)


def test_phases_of_the_harmonics_give_the_delay_a_second_time() -> None:
    """A saw has even harmonics as well, so that half periods are told apart."""
    rng = np.random.default_rng(3)
    phase = np.cumsum(1 + 0.15 * rng.normal(size=N)) / PERIOD
    saw = phase % 1.0 - 0.5
    pair = np.array([saw, np.roll(saw, 9)]) + 0.02 * rng.normal(size=(2, N))
    (found,) = propagation(pair, PERIOD)
    assert found.delay == pytest.approx(9, abs=0.3)
    assert found.phase_delay == pytest.approx(9, abs=0.4)


def test_turning_the_pair_round_turns_the_delay() -> None:
    rng = np.random.default_rng(4)
    first = swing(rng)
    pair = np.array([first, np.roll(first, 6) + 0.2 * rng.normal(size=N)])
    (there,), (back,) = propagation(pair, PERIOD), propagation(-5 * pair[::-1] + 3, PERIOD)
    assert back.delay == pytest.approx(-there.delay, abs=0.2)
    assert back.correlation == pytest.approx(there.correlation, abs=0.02)


def test_too_few_cycles_and_signals_that_do_not_move_give_no_delay() -> None:
    rng = np.random.default_rng(5)
    assert propagation(rng.normal(size=(2, 300)), PERIOD) == ()
    assert propagation(np.array([swing(rng), np.ones(N)]), PERIOD) == ()
    assert propagation(rng.normal(size=(2, 2)), 4.0) == ()
    with pytest.raises(ValueError, match="gaps bridged or left out"):
        propagation(np.full((2, N), np.nan), PERIOD)
    with pytest.raises(ValueError, match="at least 4 samples, got 2"):
        propagation(np.zeros((2, N)), 2.0)


def test_the_coherence_is_that_of_scipy() -> None:
    rng = np.random.default_rng(6)
    x = swing(rng) + 0.5 * rng.normal(size=N)
    y = np.roll(x, 5) + rng.normal(size=N)
    found = phase_locking(np.array([x, y]), PERIOD)
    assert found is not None
    length = 4 * int(PERIOD)
    # scipy's Hann window has a sample more between its zeros.
    _, theirs = signal.coherence(
        x, y, nperseg=length, noverlap=length // 2, detrend=signal.detrend
    )  # fmt: skip
    assert found.coherence[0, 1] == pytest.approx(theirs[4], rel=0.01)
    # y follows x by 5 samples: its phase falls back by that part of a turn.
    assert found.phase[0, 1] == pytest.approx(-2 * np.pi * 5 / PERIOD, abs=0.15)


def test_noise_exceeds_the_limit_as_seldom_as_it_says() -> None:
    """2,016 pairs of 64 signals at a chance of 5 %: 101, with a standard deviation of about 10."""
    noise = np.random.default_rng(7).normal(size=(64, N))
    found = phase_locking(noise, PERIOD)
    assert found is not None
    pairs = found.coherence[np.triu_indices(64, 1)]
    assert 60 <= np.count_nonzero(pairs > found.limit(0.05)) <= 150


def test_too_short_a_record_has_no_coherence() -> None:
    assert phase_locking(np.random.default_rng(8).normal(size=(2, 300)), PERIOD) is None
