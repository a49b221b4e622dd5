import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.virtual_loops import State, virtual_loops
from loop.signals import Real
from monitoring.acf_decay import acf_decay
from monitoring.basis import Confidence
from monitoring.half_periods import half_periods
from monitoring.oscillation import OscillationVerdict, oscillation
from monitoring.regularity import acf_regularity, envelope_regularity, spectrum_regularity
from monitoring.spectrum import BandFilter, band_pass, power_spectrum


def wave(n: int, period: float, *, amplitude: float = 1.0, phase: float = 0.3) -> Real:
    return np.asarray(amplitude * np.sin(2 * np.pi * np.arange(n) / period + phase))


def noise(n: int, seed: int = 0, keep: float = 0.0) -> Real:
    white = np.random.default_rng(seed).normal(size=n)
    return np.asarray(lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white))


@pytest.mark.parametrize(("period", "keep"), [(8.0, 0.0), (37.3, 0.9), (120.0, 0.97)])
def test_a_sine_as_large_as_the_noise_is_found_with_its_period_and_amplitude(
    period: float, keep: float
) -> None:
    x = wave(2000, period) + noise(2000, 3, keep)
    found = oscillation(x, 2.0)
    assert found.verdict is OscillationVerdict.PERSISTENT
    main = found.main
    assert main is not None
    assert main.period == pytest.approx(2 * period, rel=0.02)
    angle = 2 * np.pi * np.arange(2000) / period
    fitted = np.hypot(2 * np.mean(x * np.sin(angle)), 2 * np.mean(x * np.cos(angle)))
    # noise within the band adds to the amplitude of the wave alone
    assert main.amplitude == pytest.approx(fitted, rel=0.25)


def test_the_answer_follows_the_units_of_time_and_of_pv() -> None:
    x = wave(1500, 40.0) + noise(1500)
    one, other = oscillation(x, 1.0).main, oscillation(-7 * x, 60.0).main
    assert one is not None
    assert other is not None
    assert other.period == pytest.approx(60 * one.period)
    assert other.amplitude == pytest.approx(7 * one.amplitude)
    assert other.regularity == pytest.approx(one.regularity)


def test_three_oscillations_at_once_are_all_found() -> None:
    x = 1.1 * wave(3000, 20.0) + 1.2 * wave(3000, 133.0) + wave(3000, 52.0) + 0.3 * noise(3000)
    periods = sorted(c.period for c in oscillation(x, 1.0).components)
    assert periods == pytest.approx([20.0, 52.0, 133.0], rel=0.02)


def test_a_burst_is_intermittent_with_its_start_and_end() -> None:
    x = 0.2 * noise(8000, 1)
    x[3000:4000] += wave(1000, 40.0)
    found = oscillation(x, 1.0)
    assert found.verdict is OscillationVerdict.INTERMITTENT
    main = found.main
    assert main is not None
    assert (main.start, main.end) == pytest.approx((3000, 4000), abs=60)
    assert main.cycles == pytest.approx(25, abs=3)
    short = 0.5 * noise(8000, 1)
    short[3000:3400] += wave(400, 40.0)
    assert not oscillation(short, 1.0, segments=False).oscillates
    assert oscillation(short, 1.0).oscillates


def test_healthy_loops_do_not_oscillate() -> None:
    loops = list(virtual_loops(State.HEALTHY, 40, samples=1000, seed=99))
    alarms = [oscillation(one.sp - one.pv, 1.0).oscillates for one in loops]
    assert sum(alarms) <= 1


def test_what_cannot_be_judged_is_said() -> None:
    short = oscillation(noise(63), 1.0)
    assert short.verdict is OscillationVerdict.UNDECIDED
    assert short.basis.refused
    assert short.main is None
    still = oscillation(np.full(100, 3.0), 1.0)
    assert still.verdict is OscillationVerdict.NONE
    assert still.basis.reasons == ("the error does not move",)
    coarse = oscillation(wave(500, 6.0), 1.0, compressed=True)
    assert coarse.basis.confidence is Confidence.LOW
    assert len(coarse.basis.reasons) == 2


def test_the_regularity_of_a_sine_is_high_and_of_noise_low() -> None:
    period, regular, lasting = acf_regularity(wave(1000, 25.0), 25.0)
    assert period == pytest.approx(25.0, rel=1e-3)
    assert regular > 20
    assert lasting > 0.95
    assert acf_regularity(noise(1000), 25.0)[1] < 3
    assert acf_regularity(np.zeros(100), 25.0) == (25.0, 0.0, 0.0)
    assert acf_regularity(np.arange(100.0), 60.0)[1] == 0


def test_the_band_pass_keeps_its_band_and_nothing_else() -> None:
    inside, outside = wave(4000, 50.0), wave(4000, 150.0)
    kept = band_pass(inside + outside + 5.0, 50.0, width=2**0.4)
    np.testing.assert_allclose(kept[500:-500], inside[500:-500], atol=0.03)


@pytest.mark.parametrize("n", [6000, 6007])
def test_a_thinned_band_runs_through_the_points_of_the_full_one(n: int) -> None:
    signal = noise(n, 3, 0.97) + wave(n, 400.0)
    full = band_pass(signal, 400.0, width=2**0.4)
    thin, step = BandFilter.of(signal).thinned(400.0, width=2**0.4, points=48)
    assert step == pytest.approx(400 / 48, rel=0.05)
    at = np.arange(thin.size) * step
    inside = at <= n - 1
    assert np.count_nonzero(~inside) <= 1
    expected = np.interp(at[inside], np.arange(n), full)
    assert np.max(np.abs(thin[inside] - expected)) < 2e-4 * float(np.ptp(full))


def test_a_short_period_is_not_thinned() -> None:
    signal = noise(3000, 4) + wave(3000, 12.0)
    thin, step = BandFilter.of(signal).thinned(12.0, width=2**0.4, points=48)
    assert step == 1
    np.testing.assert_allclose(thin, band_pass(signal, 12.0, width=2**0.4), atol=1e-12)


@pytest.mark.parametrize("n", [6000, 6007])
def test_an_envelope_turned_by_its_carrier_is_the_band(n: int) -> None:
    signal = noise(n, 3, 0.97) + wave(n, 40.0)
    slow = BandFilter.of(signal).envelope(40.0, width=2**0.4, points=2.5)
    k = np.arange(slow.z.size)
    turned = (slow.z * np.exp(2j * np.pi * slow.cycles * k)).real
    full = band_pass(signal, 40.0, width=2**0.4)
    inside = k * slow.step <= n - 1
    expected = np.interp((k * slow.step)[inside], np.arange(n), full)
    assert np.max(np.abs(turned[inside] - expected)) < 0.01 * float(np.ptp(full))
    half_square = float(np.mean(np.abs(slow.z) ** 2)) / 2
    assert half_square == pytest.approx(float(np.mean(full**2)), rel=1e-3)


@pytest.mark.parametrize("period", [9.0, 26.7])
def test_the_regularity_of_an_envelope_is_that_of_the_wave(period: float) -> None:
    signal = wave(20_000, period) + noise(20_000, 8, 0.8)
    band = BandFilter.of(signal)
    slow = band.envelope(period, width=2**0.4, points=2.5)
    fine = band_pass(signal, period, width=2**0.4)
    other = acf_regularity(fine, period)
    for one in (
        envelope_regularity(slow, 0, slow.z.size, period),
        spectrum_regularity(band, period, width=2**0.4),
    ):
        assert one[0] == pytest.approx(other[0], rel=2e-3)
        assert one[1] == pytest.approx(other[1], rel=0.15)
        assert one[2] == pytest.approx(other[2], rel=5e-3)
    still = BandFilter.of(np.zeros(20_000)).envelope(9.0, width=2**0.4, points=2.5)
    assert envelope_regularity(still, 0, still.z.size, 9.0) == (9.0, 0.0, 0.0)


def test_a_long_record_is_answered_like_a_short_one() -> None:
    x = wave(30_000, 11.3) + 0.7 * noise(30_000, 2, 0.5)
    long, short = (oscillation(part, 1.0, segments=False).main for part in (x, x[:9000]))
    assert long is not None
    assert short is not None
    assert long.persistent
    assert long.period == pytest.approx(short.period, rel=1e-3)
    assert long.amplitude == pytest.approx(short.amplitude, rel=0.02)
    assert long.end == 30_000
    assert not oscillation(noise(30_000, 9, 0.9), 1.0, segments=False).oscillates


def test_a_burst_in_a_long_record_is_read_from_the_envelope_of_its_part() -> None:
    x = 0.2 * noise(30_000, 1)
    x[9000:10_000] += wave(1000, 12.0)
    main = oscillation(x, 1.0).main
    assert main is not None
    assert (main.start, main.end) == pytest.approx((9000, 10_000), abs=30)
    assert main.period == pytest.approx(12.0, rel=2e-3)
    assert not main.persistent


def test_as_many_oscillations_are_looked_for_as_asked() -> None:
    x = wave(2000, 20.0) + 1.2 * wave(2000, 133.0) + 0.3 * noise(2000)
    assert len(oscillation(x, 1.0, most=1).components) == 1
    assert oscillation(x, 1.0, most=1).main == oscillation(x, 1.0).main


@pytest.mark.parametrize("n", [1000, 1125])
def test_the_window_needs_no_second_transform(n: int) -> None:
    signal = noise(n, 6, 0.9) + wave(n, 31.0)
    band = BandFilter.of(signal)
    assert band.length == n
    np.testing.assert_allclose(band.power(), power_spectrum(signal), rtol=1e-6, atol=1e-6)


def test_scores_of_white_noise_average_to_one_and_a_line_stands_out_as_theory_says() -> None:
    white = BandFilter.of(noise(65_536, 5)).lines(fewest_cycles=40, shortest=4.0)
    assert np.mean(white.scores) == pytest.approx(1.0, rel=0.1)
    line = BandFilter.of(wave(4096, 32.0) + noise(4096)).lines(fewest_cycles=6, shortest=4.0)
    # A^2 n/4 over the noise, two thirds of it under a Hann window
    assert line.scores.max() == pytest.approx(4096 / 4 / 1.5, rel=0.35)
    assert line.share(32.0, 2**0.4) == pytest.approx(1 / 3 + 0.1, abs=0.1)
    still = BandFilter.of(np.zeros(128)).lines(fewest_cycles=6, shortest=4.0)
    assert still.share(9.0, 1.3) == 0


def test_half_periods_of_a_sine_have_the_area_of_theory() -> None:
    span, Ti = 100.0, 40.0
    # amplitude just above and below 1 % of span at the period Ti: IAE = 2 a/w
    for amplitude, events in ((1.05, 99), (0.9, 0)):
        e = amplitude * np.sin(2 * np.pi * np.arange(4000) / 40.0 + 1e-3)
        found = half_periods(e, 1.0, pv_span=span, Ti=Ti)
        assert found.limit == pytest.approx(2 * 1.0 / (2 * np.pi / Ti))
        assert found.likeness == 1.0
        assert found.events == pytest.approx(events, abs=3)
        assert found.alarm is (events > 0)
    without = half_periods(noise(4000), 1.0, pv_span=None, Ti=None)
    assert without.events is None
    assert without.likeness < 0.4
    assert half_periods(np.arange(50.0), 1.0, pv_span=1.0, Ti=1.0).basis.refused


@pytest.mark.parametrize("zeta", [0.1, 0.2, 0.35])
def test_the_decay_ratio_is_that_of_a_second_order_loop(zeta: float) -> None:
    w = 2 * np.pi / 40
    radius, angle = np.exp(-zeta * w), w * np.sqrt(1 - zeta**2)
    x = lfilter([1.0], [1, -2 * radius * np.cos(angle), radius**2], noise(60_000, 8))
    found = acf_decay(x, 1.0)
    assert found.ratio == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), abs=0.06)
    assert found.lively is (zeta < 0.2155)
    assert found.period == pytest.approx(40, rel=0.1)


def test_an_autocorrelation_without_swing_has_no_decay_ratio() -> None:
    assert acf_decay(noise(4000, 2, 0.97), 1.0).ratio < 0.5
    drift = acf_decay(np.arange(400.0), 1.0)
    assert drift.period is None
    assert acf_decay(np.ones(20), 1.0).basis.refused
