import numpy as np
import pytest
from scipy.signal import lfilter

from loop.controller import PID
from loop.process import FOPDT
from loop.signals import Real
from loop.simulation import simulate
from loop.valve import Kano, stem_positions
from monitoring.bicoherence import bicoherence
from monitoring.cross_correlation import correlations, cross_correlation
from monitoring.mean_cycle import POINTS, mean_cycle
from monitoring.op_pv_figure import apparent_stiction
from monitoring.stem_rests import stem_rests
from monitoring.stiction_result import StictionVerdict
from monitoring.stiction_search import stiction_search
from monitoring.wave_shapes import (
    area_ratio,
    hagglund_index,
    harmonic,
    he_index,
    relay_misfit,
    rossi_scali_index,
    sine_misfit,
    slope_kurtosis,
    triangle_misfit,
)

PHASE = 2 * np.pi * np.arange(POINTS) / POINTS
SINE = np.sin(PHASE)
TRIANGLE = 2 / np.pi * np.arcsin(np.sin(PHASE))
SQUARE = np.sign(np.sin(PHASE + 1e-6))


def test_the_curve_fits_know_sine_triangle_and_relay_response() -> None:
    # power of a triangle and of a square outside their fundamental: 1 - 96/pi^4, 1 - 8/pi^2
    assert sine_misfit(TRIANGLE) == pytest.approx(1 - 96 / np.pi**4, abs=0.002)
    assert sine_misfit(SQUARE) == pytest.approx(1 - 8 / np.pi**2, abs=0.01)
    assert triangle_misfit(TRIANGLE) == pytest.approx(0, abs=1e-9)
    assert he_index(SINE) == pytest.approx(0, abs=0.02)
    assert he_index(TRIANGLE) == pytest.approx(1, abs=0.02)
    relay = np.exp(-np.arange(32) / 32 / 0.2)
    relay = 1 - 2 * relay / (1 + np.exp(-5))
    assert relay_misfit(np.r_[relay, -relay]) == pytest.approx(0, abs=1e-9)
    assert rossi_scali_index(np.r_[relay, -relay]) == pytest.approx(1, abs=1e-3)
    assert rossi_scali_index(SINE) == pytest.approx(-1, abs=0.05)
    assert hagglund_index(SQUARE) > 0.9
    assert hagglund_index(SINE) < -0.9


def test_the_shape_does_not_depend_on_size_phase_or_sign() -> None:
    turned = -3 * np.roll(TRIANGLE, 17)
    assert he_index(turned) == pytest.approx(he_index(TRIANGLE), abs=1e-9)
    assert slope_kurtosis(turned) == pytest.approx(slope_kurtosis(TRIANGLE))
    assert area_ratio(turned) == pytest.approx(area_ratio(TRIANGLE), abs=0.02)


def test_the_area_ratio_is_that_of_the_geometry() -> None:
    rise, fall = 20, 12
    half = np.r_[np.arange(rise) / rise, 1 - np.arange(fall) / fall]
    # areas before and after the peak of a sawtooth are as its two sides; the eight harmonics that
    # are kept blunt its corner by a few of the 64 points
    assert 1.2 < area_ratio(np.r_[half, -half]) < rise / fall
    assert 1 / area_ratio(np.r_[half[::-1], -half[::-1]]) > 1.2
    assert area_ratio(SINE) == pytest.approx(1, abs=0.15)


def test_slopes_and_harmonics_are_those_of_theory() -> None:
    assert slope_kurtosis(SINE) == pytest.approx(1.5, abs=1e-3)
    assert slope_kurtosis(TRIANGLE) == pytest.approx(1.0, abs=0.05)
    assert slope_kurtosis(SQUARE) > 10
    assert harmonic(TRIANGLE, 3) == pytest.approx(1 / 81, rel=0.02)
    assert harmonic(SQUARE, 3) == pytest.approx(1 / 9, rel=0.05)


def test_a_wave_that_does_not_move_has_no_shape() -> None:
    flat = np.zeros(POINTS)
    assert sine_misfit(flat) == triangle_misfit(flat) == 1
    assert he_index(flat) == 0.5
    assert hagglund_index(flat) == harmonic(flat, 3) == rossi_scali_index(flat) == 0
    assert area_ratio(flat) == 1
    assert slope_kurtosis(flat) == 1.5
    assert area_ratio(np.r_[np.tile([1.0, -1.0], 32)]) == pytest.approx(1.0, abs=9)


def repeated(wave: Real, cycles: int, period: float, *, noise: float = 0.0) -> Real:
    n = int(cycles * period)
    x = np.interp((np.arange(n) / period % 1) * POINTS, np.arange(POINTS + 1), np.r_[wave, wave[0]])
    return np.asarray(x + noise * np.random.default_rng(0).normal(size=n))


def test_the_mean_cycle_gives_back_the_wave_under_noise_and_drift() -> None:
    op = repeated(TRIANGLE, 40, 31.7, noise=0.2) + np.linspace(0, 3, int(40 * 31.7))
    found = mean_cycle(op, 2 * op, 31.7)
    assert found is not None
    np.testing.assert_allclose(found.op, TRIANGLE, atol=0.12)
    np.testing.assert_allclose(found.pv, 2 * found.op, atol=1e-9)
    assert found.op_likeness > 0.85
    assert found.cycles >= 36
    assert mean_cycle(np.zeros(500), op[:500], 30.0) is None
    assert mean_cycle(op[:90], op[:90], 31.7) is None


def test_the_cross_correlation_is_that_of_numpy() -> None:
    rng = np.random.default_rng(1)
    u, y = rng.normal(size=300), rng.normal(size=300)
    found = correlations(u, y, 40)
    assert found is not None
    u0, y0 = u - u.mean(), y - y.mean()
    full = np.correlate(y0, u0, "full") / np.sqrt((u0 @ u0) * (y0 @ y0))
    np.testing.assert_allclose(found, full[299 - 40 : 299 + 41], atol=1e-12)
    assert correlations(np.ones(50), y[:50], 5) is None


def test_horch_calls_a_quarter_period_odd_and_no_shift_even() -> None:
    n = 2000
    wave = np.sin(2 * np.pi * np.arange(n) / 40)
    quarter = np.sin(2 * np.pi * (np.arange(n) - 9.9) / 40)
    odd, even = cross_correlation(wave, quarter, 40.0), cross_correlation(wave, -wave, 40.0)
    assert odd is not None
    assert even is not None
    assert odd.odd
    assert not odd.even
    assert even.even
    assert even.largest == pytest.approx(1.0, abs=1e-3)
    assert cross_correlation(wave, np.zeros(n), 40.0) is None
    assert cross_correlation(np.arange(50.0), np.arange(50.0), 4.0) is None


def test_bicoherence_fires_on_a_skewed_signal_and_is_silent_on_gaussian_and_symmetric_ones() -> (
    None
):
    white = np.random.default_rng(3).normal(size=4096)
    coloured = lfilter([1.0], [1.0, -0.6], white)
    gaussian = bicoherence(coloured)
    assert gaussian is not None
    assert gaussian.NGI < 0.001
    assert gaussian.NLI is None
    assert not gaussian.nonlinear
    squared = bicoherence(coloured + 0.4 * coloured**2)
    assert squared is not None
    assert squared.NGI > 0.001
    assert squared.nonlinear
    assert bicoherence(white[:500]) is None
    assert bicoherence(np.zeros(4096)) is None


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_bicoherence_is_that_of_its_definition_in_any_unit(scale: float) -> None:
    x = lfilter([1.0], [1.0, -0.6], np.random.default_rng(4).normal(size=4096))
    x = scale * (x + 0.3 * x**2)
    x[2000] += 40 * scale
    found = bicoherence(x)
    assert found is not None
    rows = np.array([x[k : k + 64] for k in range(0, 4096 - 63, 32)])
    X = np.fft.fft((rows - rows.mean(axis=1, keepdims=True)) * np.hanning(64), 128)
    bic2, floors = [], []
    for f in range(2, 63):
        for g in range(2, min(f, 64 - f) + 1):
            pair, both = X[:, f] * X[:, g], X[:, f + g]
            bic2.append(abs(np.sum(pair * np.conj(both))) ** 2)
            floors.append(np.sum(np.abs(pair) ** 2) * np.sum(np.abs(both) ** 2))
    ratio = np.array(bic2) / (np.array(floors) + 1e-3 * np.mean(floors))
    size, count = ratio.size, len(rows)
    limit = (1.645 + np.sqrt(4 * size - 1)) ** 2 / (4 * count * size)
    non_gaussian = np.mean(ratio) - limit
    nonlinear = abs(np.max(ratio) - np.mean(ratio) - 2 * np.std(ratio))
    # the pairs are in single precision
    np.testing.assert_allclose([found.NGI, found.NLI], [non_gaussian, nonlinear], rtol=1e-5)


@pytest.mark.parametrize("S", [1.0, 5.0])
def test_the_apparent_stiction_of_a_dead_band_shrinks_from_its_width_with_the_lag(S: float) -> None:
    op = 10 * np.sin(2 * np.pi * np.arange(3000) / 100)
    stem = stem_positions(Kano(S=S, J=0.0), op)
    # moments of the figure: half the chord of an ellipse with the same lag of the fundamental
    spectrum = [np.fft.rfft(x)[30] for x in (op, stem)]
    lag = abs(np.angle(spectrum[0] / spectrum[1]))
    at_rest = apparent_stiction(op, stem, 100.0)
    assert at_rest is None or at_rest < 2 * 10 * np.sin(lag) + 1
    assert apparent_stiction(op, np.zeros(3000), 100.0) is None
    assert apparent_stiction(op, op, 100.0) is None


def test_an_ellipse_has_the_chord_of_its_formula() -> None:
    angle = 2 * np.pi * np.arange(4000) / 80
    # two independent waves beside a common one: correlation known, no lag aligns them
    op, pv = np.sin(angle), np.sin(angle) + 0.5 * np.sin(angle * 1.37)
    u, y = op - op.mean(), pv - pv.mean()
    rho = float(u @ y / np.sqrt((u @ u) * (y @ y)))
    found = apparent_stiction(op, pv, 80.0)
    assert found == pytest.approx(2 * np.sqrt(2) * np.std(op) * np.sqrt(1 - rho**2), rel=0.15)


def sticking(S: float, J: float) -> tuple[Real, Real, Real]:
    run = simulate(
        FOPDT(K=1.0, tau=10.0, theta=3.0), PID(Kc=1.4, Ti=10.0), t_end=1500.0, dt=1.0,
        load=np.where(np.arange(1501) < 10, 0.0, 3.0), noise=0.05,
        rng=np.random.default_rng(0), valve=Kano(S=S, J=J),
    )  # fmt: skip
    return run.op, run.pv, stem_positions(Kano(S=S, J=J), run.op, position=0.0)


@pytest.mark.parametrize(("S", "J"), [(3.0, 1.0), (5.0, 3.0), (6.0, 6.0)])
def test_the_search_finds_the_valve_that_was_simulated(S: float, J: float) -> None:
    op, pv, _ = sticking(S, J)
    found = stiction_search(op, pv, 50.0)
    assert found.S is not None
    assert found.J is not None
    assert abs(found.S / S - 1) < 0.2
    assert 0 <= found.J <= 1.01 * found.S
    assert found.improvement is not None
    assert found.improvement > 0.2


def test_the_search_finds_no_valve_where_there_is_none() -> None:
    rng = np.random.default_rng(0)
    run = simulate(
        FOPDT(K=1.0, tau=10.0, theta=3.0), PID(Kc=1.4, Ti=10.0), t_end=1500.0, dt=1.0,
        output_load=2 * np.sin(np.arange(1501) / 8), noise=0.1, rng=rng,
    )  # fmt: skip
    found = stiction_search(run.op, run.pv, 50.0)
    assert found.S is None
    assert found.basis.reasons == ("a valve without friction explains the data as well",)
    assert stiction_search(np.ones(500), run.pv[:500], 50.0).basis.refused


def test_rests_of_a_known_stem_are_told_from_a_free_one() -> None:
    op, _, stem = sticking(5.0, 3.0)
    sticky = stem_rests(op, stem, smallest_move=0.01)
    assert sticky.verdict is StictionVerdict.STICTION
    free = stem_rests(op, op, smallest_move=0.01)
    assert free.verdict is StictionVerdict.NONE
    assert free.rests == pytest.approx(0, abs=0.05)
    assert free.jump is None or free.jump >= 0
    assert stem_rests(np.ones(100), stem[:100], smallest_move=0.01).basis.refused
    with pytest.raises(ValueError, match="smallest_move must be positive"):
        stem_rests(op, stem, smallest_move=0.0)
