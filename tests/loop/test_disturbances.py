"""Disturbances against their own statistics."""

import numpy as np
import pytest

from loop.disturbances import coloured_noise, random_walk, sudden_moves, swing

T = np.arange(100_000) * 2.0


def test_coloured_noise_has_its_spread_and_its_memory() -> None:
    """Lag k of the autocorrelation is e^(-k dt/memory); its own error is about sqrt(memory/T)."""
    noise = coloured_noise(T, memory=50.0, size=3.0, rng=np.random.default_rng(3), settled=True)
    assert np.std(noise) == pytest.approx(3, rel=0.05)
    for lag in (5, 25):
        found = np.mean(noise[lag:] * noise[:-lag]) / np.mean(noise**2)
        assert found == pytest.approx(np.exp(-lag * 2 / 50), abs=0.04)


def test_coloured_noise_starts_at_rest_or_anywhere() -> None:
    starts = {
        settled: [
            coloured_noise(
                T[:3], memory=9, size=2, rng=np.random.default_rng(seed), settled=settled
            )[0]
            for seed in range(400)
        ]
        for settled in (False, True)
    }
    assert set(starts[False]) == {0.0}
    assert np.std(starts[True]) == pytest.approx(2, rel=0.15)


def test_a_random_walk_spreads_with_the_root_of_time() -> None:
    t = np.arange(200) * 5.0
    walks = np.array(
        [random_walk(t, spread=0.3, rng=np.random.default_rng(seed)) for seed in range(600)]
    )
    assert np.all(walks[:, 0] == 0)
    for k in (50, 199):
        assert np.std(walks[:, k]) == pytest.approx(0.3 * np.sqrt(t[k]), rel=0.12)


def test_sudden_moves_jump_as_often_as_asked_within_their_size() -> None:
    level = sudden_moves(T, every=400.0, size=1.5, rng=np.random.default_rng(8))
    assert level[0] == 0
    assert np.max(np.abs(level)) <= 1.5
    assert np.count_nonzero(np.diff(level)) == pytest.approx(500, abs=4 * 22)


def test_a_swing_lasts_from_its_start_to_its_end() -> None:
    t = np.arange(0, 100.0)
    wave = swing(t, period=20, amplitude=3, start=20, end=60)
    assert np.all(wave[:20] == 0)
    assert np.all(wave[60:] == 0)
    np.testing.assert_allclose(wave[25], 3)
    np.testing.assert_allclose(wave[35], -3)
    np.testing.assert_allclose(swing(t, period=20, amplitude=1, phase=np.pi / 2)[0], 1)


def test_impossible_disturbances_are_refused() -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(ValueError, match="memory must be positive"):
        coloured_noise(T, memory=0, size=1, rng=rng)
    with pytest.raises(ValueError, match="every must be positive"):
        sudden_moves(T, every=-1, size=1, rng=rng)
    with pytest.raises(ValueError, match="two evenly spaced instants"):
        random_walk(T[:1], spread=1, rng=rng)
    with pytest.raises(ValueError, match="period must be positive"):
        swing(T, period=0, amplitude=1)
