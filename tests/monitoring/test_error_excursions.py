import numpy as np
import pytest

from monitoring.controller_moves import controller_moves
from monitoring.error_excursions import error_excursions


def pi_output(error: np.ndarray, Kc: float, Ti: float) -> np.ndarray:
    return 40 + Kc * (error + np.cumsum(error) / Ti)


@pytest.mark.parametrize(("Kc", "Ti"), [(2.0, 30.0), (-0.4, 8.0), (0.05, 300.0)])
def test_settings_come_back_from_what_a_pi_controller_did(Kc: float, Ti: float) -> None:
    error = np.random.default_rng(1).normal(size=900)
    op = pi_output(error, Kc, Ti)
    found = controller_moves(op, error)
    assert found.explained == pytest.approx(1.0, abs=1e-6)
    assert found.Ti == pytest.approx(Ti, rel=1e-6)
    assert found.proportional == pytest.approx(abs(Kc) * np.std(error) / np.std(op), rel=1e-6)
    assert found.integral == pytest.approx(found.proportional * 900 / Ti, rel=1e-6)
    scaled = controller_moves(7 * op - 3, 0.2 * error)
    assert scaled.Ti == pytest.approx(found.Ti)
    assert scaled.integral == pytest.approx(found.integral)


def test_other_moves_are_not_explained_and_what_rests_has_no_settings() -> None:
    rng = np.random.default_rng(2)
    error, op = rng.normal(size=(2, 900))
    assert controller_moves(op, error).explained < 0.2
    still = controller_moves(op, np.zeros(900))
    assert (still.explained, still.Ti) == (0.0, 20 * 900)
    assert np.isfinite(controller_moves(np.ones(900), error).integral)


def test_excursions_are_counted_and_weighed() -> None:
    error = np.concatenate([np.full(100, 2.0), np.full(300, -1.0), np.full(200, 1.0)])
    found = error_excursions(error, noise=0.0, Ti=50.0)
    assert found.count == 3
    # Smoothed over 10 samples: ends move by a few.
    assert found.longest == pytest.approx(0.5, abs=0.02)
    # 400, 300 and 200 of energy; 300 and 200 samples last for more than 150.
    assert found.long_share == pytest.approx(500 / 900, abs=0.02)
    assert found.left == pytest.approx(1.0, abs=0.02)
    assert error_excursions(error, noise=0.0, Ti=200.0).long_share == 0.0


def test_an_error_within_noise_has_no_excursions() -> None:
    quiet = error_excursions(np.zeros(300), noise=1.0, Ti=10.0)
    assert (quiet.count, quiet.longest, quiet.long_share) == (0, 0.0, 0.0)
    fading = error_excursions(np.exp(-np.arange(300) / 30), noise=1e-9, Ti=10.0)
    assert fading.count == 1
    assert fading.left < 0.15
    wave = np.sin(2 * np.pi * np.arange(400) / 40)
    assert error_excursions(wave, 0.01, 20.0).first_crossing == pytest.approx(10 / 400, abs=1 / 400)
