from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.burst_detection import Noise, errors, tries
from loop.signals import Flags, Real
from monitoring.bursts import Burst, BurstSearch
from monitoring.oscillation import OscillationVerdict, oscillation
from monitoring.spectrum import BandFilter


def noise(n: int, seed: int = 0, keep: float = 0.0) -> Real:
    white = np.random.default_rng(seed).normal(size=n)
    return np.asarray(lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white))


def with_burst(x: Real, period: float, first: int, cycles: float, *, amplitude: float) -> Real:
    y = x.copy()
    t = np.arange(round(cycles * period))
    y[first : first + t.size] += amplitude * np.sin(2 * np.pi * t / period + 0.7)
    return y


def none(periods: Real, samples: float) -> Flags:  # noqa: ARG001 - as the search asks
    return np.zeros(periods.size, dtype=np.bool_)


def strongest(x: Real) -> Burst | None:
    return BurstSearch(BandFilter.of(x)).strongest(none)


@pytest.mark.parametrize(
    ("period", "first", "cycles", "keep"),
    [(9.0, 700, 16.0, 0.0), (30.0, 1500, 8.0, 0.0), (130.0, 400, 7.0, 0.5), (12.0, 900, 8.0, 0.9)],
)
def test_a_burst_as_large_as_the_sd_of_the_noise_is_found_where_it_is(
    period: float, first: int, cycles: float, keep: float
) -> None:
    x = with_burst(noise(2000, 4, keep), period, first, cycles, amplitude=1.0)
    found = strongest(x)
    assert found is not None
    assert found.period == pytest.approx(period, rel=0.03)
    assert found.start == pytest.approx(first, abs=2.5 * period)
    assert found.end == pytest.approx(first + cycles * period, abs=2.5 * period)
    assert found.amplitude == pytest.approx(1.0, abs=0.35)
    seen = oscillation(x, 2.0)
    assert seen.verdict is not OscillationVerdict.NONE
    assert seen.main is not None
    assert seen.main.period == pytest.approx(2 * period, rel=0.03)


def test_the_score_is_the_power_of_the_tone_over_that_of_the_noise() -> None:
    # A^2 n/4 of a sine over the variance of white noise
    scores = []
    for seed in range(12):
        found = strongest(with_burst(noise(4096, seed), 25.0, 1000, 40.0, amplitude=1.0))
        assert found is not None
        scores.append(found.score)
    assert np.mean(scores) == pytest.approx(1000 / 4, rel=0.15)


def test_a_tone_is_found_once_and_two_bursts_at_two_times_both() -> None:
    x = with_burst(0.5 * noise(6000, 3), 20.0, 500, 20.0, amplitude=1.0)
    x = with_burst(x, 90.0, 3500, 12.0, amplitude=1.0)
    search = BurstSearch(BandFilter.of(x))
    found = [search.strongest(none) for _ in range(3)]
    assert sorted(one.period for one in found if one) == pytest.approx([20.0, 90.0], rel=0.02)
    search = BurstSearch(BandFilter.of(x))
    rest = search.strongest(lambda periods, _: np.abs(np.log(periods / 90)) < 0.5)
    assert rest is not None
    assert rest.period == pytest.approx(20.0, rel=0.02)


def test_a_transient_that_swings_out_is_no_burst() -> None:
    x = 0.3 * noise(2000, 7)
    t = np.arange(400)
    x[800:1200] += 4 * np.exp(-t / 30) * np.sin(2 * np.pi * t / 40)
    assert strongest(x) is None


def test_noise_and_what_is_too_short_hold_no_burst() -> None:
    assert all(strongest(noise(1500, seed, keep)) is None for seed in range(4) for keep in (0, 0.9))
    assert strongest(np.r_[noise(40), np.zeros(30)]) is None
    assert strongest(np.zeros(200)) is None
    assert strongest(noise(50)) is None


def test_a_burst_in_silence_is_found() -> None:
    found = strongest(with_burst(np.zeros(2000), 30.0, 500, 10.0, amplitude=2.0))
    assert found is not None
    assert found.amplitude == pytest.approx(2.0, rel=0.05)


def test_a_strong_wave_that_lags_would_predict_is_found() -> None:
    # eleven slow cycles of it are a hundred samples at the rate at which they are fitted
    strong = with_burst(noise(2000, 4, 0.9), 150.0, 100, 11.5, amplitude=6.0)
    found = strongest(strong)
    assert found is not None
    assert found.likelihood < found.standing / 2
    assert found.period == pytest.approx(150, rel=0.02)


def test_longer_records_shorter_periods_and_fainter_waves_ask_for_more() -> None:
    one = Burst(
        period=20.0, start=100.0, end=300.0, score=30.0, likelihood=25.0, standing=20.0,
        evenness=1.0, share=0.3, amplitude=1.0,
    )  # fmt: skip
    assert one.cycles == 10
    assert one.evidence(2000) == pytest.approx(25 - np.log(100))
    assert one.evidence(2000) - one.evidence(20_000) == pytest.approx(np.log(10))
    assert one.evidence(2000) - replace(one, period=10.0).evidence(2000) == pytest.approx(np.log(2))
    faint, strong, all_of_it = (replace(one, share=s).evidence(2000) for s in (0.2, 0.5, 1.0))
    assert faint < one.evidence(2000) < strong
    assert all_of_it == strong
    for strong_one in (replace(one, score=80.0), replace(one, standing=80.0)):
        assert strong_one.evidence(2000) == pytest.approx(40 - np.log(100))


def test_a_tone_that_fills_the_record_is_told_from_its_own_surroundings() -> None:
    # nothing is left outside that could tell the noise
    found = strongest(with_burst(noise(640, 2), 32.0, 0, 20.0, amplitude=1.0))
    assert found is not None
    assert found.cycles > 14


@pytest.mark.parametrize("noise_kind", list(Noise))
def test_most_waves_as_large_as_the_noise_are_found(noise_kind: Noise) -> None:
    made = list(tries(noise_kind, 12, seed=21))
    assert sum(one.found for one in made) >= 8
    assert all(0 <= one.ideal <= 1 for one in made)


def test_the_spectrum_told_to_the_ideal_detector_is_that_of_the_loop() -> None:
    # Median of the periodogram over the spectrum: log 2, whatever the loop
    ratios = []
    for error, spectrum in errors(Noise.LOOP, 30, seed=8):
        bins = np.arange(20, 980, 7)
        power = np.abs(np.fft.rfft(error * np.hanning(error.size))) ** 2 / (0.375 * error.size)
        told = np.array([spectrum(error.size / k) for k in bins])
        ratios.append(np.median(power[bins] / told) / np.log(2))
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)
