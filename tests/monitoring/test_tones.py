import numpy as np
import pytest
from scipy.signal import lfilter

from loop.signals import Real
from monitoring import tones
from monitoring.tones import fit_tone, frequency_of, part_of


def noise(n: int, seed: int, phi: float) -> Real:
    white = np.random.default_rng(seed).normal(size=n + 200)
    return np.asarray(lfilter([np.sqrt(1 - phi**2)], [1.0, -phi], white)[200:])


def tone(n: int, f: float, first: int, stop: int, amplitude: float) -> Real:
    t = np.arange(n)
    inside = (t >= first) & (t < stop)
    return np.asarray(amplitude * np.sin(2 * np.pi * f * t + 0.4) * inside)


def spectrum(phi: float, f: float) -> float:
    return float((1 - phi**2) / abs(1 - phi * np.exp(-2j * np.pi * f)) ** 2)


@pytest.mark.parametrize(("phi", "f"), [(0.0, 0.05), (0.8, 0.05), (0.95, 0.02), (-0.6, 0.1)])
def test_the_score_is_the_power_of_the_tone_over_the_spectrum_of_the_noise(
    phi: float, f: float
) -> None:
    # A^2 n/4 over the spectrum at f, which the tone itself does not raise
    amplitude = np.sqrt(spectrum(phi, f))
    found = [
        fit_tone(noise(2000, k, phi) + tone(2000, f, 700, 1300, amplitude), f, 800, 1200, reach=600)
        for k in range(16)
    ]
    assert np.mean([one.score for one in found]) == pytest.approx(600 / 4, rel=0.12)
    assert np.median([one.f for one in found]) == pytest.approx(f, rel=2e-3)
    assert np.median([one.first for one in found]) == pytest.approx(700, abs=1.5 / f)
    assert np.median([one.stop for one in found]) == pytest.approx(1300, abs=1.5 / f)


def test_the_likelihood_is_that_of_two_regressions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tones, "HUBER", np.inf)
    monkeypatch.setattr(tones, "ORDER", 3)
    monkeypatch.setattr(tones, "WHITE", 1e-12)
    phi, f, n = 0.7, 0.04, 900
    y = noise(n, 1, phi) + tone(n, f, 300, 600, 1.0)
    found = fit_tone(y, f, 300, 600, reach=200)
    t = np.arange(3, n)
    inside = (t >= found.first) & (t < found.stop)
    angle = 2 * np.pi * found.f * t
    wave = [np.cos(angle) * inside, np.sin(angle) * inside]
    by_order = {}
    for order in range(4):
        past = [np.ones(n - 3), *(y[3 - k : n - k] for k in range(1, order + 1))]
        left = [
            np.linalg.lstsq(np.column_stack(columns), y[3:], rcond=None)[1][0]
            for columns in (past, [*past, *wave])
        ]
        by_order[(n - 3) * np.log(left[1]) + order * np.log(n - 3)] = left
    alone, both = by_order[min(by_order)]
    assert found.likelihood == pytest.approx((n - 3) / 2 * np.log(alone / both), rel=1e-5)


def test_noise_alone_has_the_likelihood_of_noise() -> None:
    # fitted where it happened to be asked: twice the likelihood is about chi-square of 2
    monkeys = []
    for k in range(200):
        model = tones._Model(noise(600, k, 0.9))
        monkeys.append(model.fit(0.06, 200, 400))
    score, likelihood = np.mean(monkeys, axis=0)
    assert score == pytest.approx(1.0, abs=0.25)
    assert likelihood == pytest.approx(1.0, abs=0.25)


def test_a_step_passes_neither_for_noise_nor_for_a_tone() -> None:
    # A load rings through the loop: one innovation, and the echo that the noise has as well
    phi, f = 0.9, 0.04
    x = tone(2000, f, 900, 1200, 1.5)
    echo = np.zeros(2000)
    echo[400:] = 10 * phi ** np.arange(1600)
    calm, rung = (
        fit_tone(noise(2000, 5, phi) + x + more, f, 900, 1200, reach=300) for more in (0.0, echo)
    )
    assert rung.score == pytest.approx(calm.score, rel=0.05)
    assert rung.likelihood == pytest.approx(calm.likelihood, rel=0.05)


def test_far_samples_do_not_matter() -> None:
    y = noise(9000, 3, 0.5) + tone(9000, 0.05, 4000, 4400, 1.0)
    one = fit_tone(y, 0.05, 4000, 4400, reach=300)
    y[:2500] *= 40.0
    y[6500:] *= 0.01
    assert fit_tone(y, 0.05, 4000, 4400, reach=300) == one


def test_a_tone_is_placed_from_a_rough_guess() -> None:
    f, first, stop = part_of(tone(1000, 0.05, 300, 700, 1.0), 0.0515, 400, 500, reach=450)
    assert f == pytest.approx(0.05, abs=2e-5)
    assert (first, stop) == pytest.approx((300, 700), abs=20)
    assert frequency_of(tone(400, 0.05, 0, 400, 1.0), 0.051) == pytest.approx(0.05, abs=2e-5)
