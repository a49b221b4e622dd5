from collections.abc import Callable

import numpy as np
import pytest

from loop import second_order as so
from loop.controller import PID
from loop.frequency_curves import bandwidths
from loop.margins import margins
from loop.process import TransferFunction


@pytest.mark.parametrize(
    ("phase", "zeta", "overshoot"), [(45, 0.420, 0.233), (60, 0.612, 0.088), (70, 0.803, 0.014)]
)
def test_phase_margin_damping_and_overshoot_go_together(
    phase: float, zeta: float, overshoot: float
) -> None:
    found = so.damping_for_phase_margin(phase)

    assert found == pytest.approx(zeta, abs=0.0006)
    assert so.overshoot(found) == pytest.approx(overshoot, abs=0.0006)
    assert so.damping_for_overshoot(so.overshoot(found)) == pytest.approx(found, rel=1e-12)
    # The loop behind it has that margin, crossover and bandwidth.
    loop = TransferFunction((1.0,), (1.0, 2 * found, 0.0))
    assert margins(loop, PID(Kc=1)).phase == pytest.approx(phase)
    measured = bandwidths(loop, PID(Kc=1))
    assert measured.wc == pytest.approx(so.crossover(found), rel=1e-9)
    assert pytest.approx(so.bandwidth(found), rel=1e-9) == measured.T


def test_bandwidth_over_crossover_lies_between_the_stated_numbers() -> None:
    ratio = [so.bandwidth(z) / so.crossover(z) for z in map(so.damping_for_phase_margin, (45, 70))]

    np.testing.assert_allclose(ratio, [1.61, 1.48], atol=0.005)


@pytest.mark.parametrize(("zeta", "rise"), [(0.3, 1.321), (0.5, 1.638), (0.7, 2.126), (1.0, 3.358)])
def test_rise_times_are_those_without_a_closed_form(zeta: float, rise: float) -> None:
    assert so.rise_time(zeta) == pytest.approx(rise, abs=0.0006)


@pytest.mark.parametrize("zeta", [0.05, 0.2, 0.6, 0.779, 0.78, 0.9, 1.0, 1.9])
def test_settling_and_overshoot_are_those_of_the_response_itself(zeta: float) -> None:
    t = np.linspace(0, 100, 400_001)
    y = so.step(zeta, t)
    outside = np.flatnonzero(np.abs(y - 1) > 0.02)

    assert so.settling_time(zeta) == pytest.approx(t[outside[-1]], abs=5e-4)
    assert y.max() - 1 == pytest.approx(so.overshoot(zeta), abs=1e-6)


def test_four_over_zeta_wn_is_no_settling_time() -> None:
    zeta = np.linspace(0.1, 0.9, 161)
    ratio = np.array([so.settling_time(float(z)) * z / 4 for z in zeta])

    assert ratio.min() < 0.75
    assert ratio.max() > 1.0


def test_a_specification_and_its_poles_go_back_and_forth() -> None:
    region = so.pole_region(overshoot=0.1, settling=8.0, rise=2.0)
    assert region.zeta_min == pytest.approx(0.591, abs=0.0005)

    for zeta, wn in zip(region.zeta[::10], region.wn_min[::10], strict=True):
        made = so.second_order(float(zeta), float(wn))
        assert made.overshoot <= 0.1 + 1e-12
        slack = max(made.settling / 8.0, made.rise / 2.0)
        assert slack == pytest.approx(1.0)
        assert region.holds(float(zeta), float(wn) * 1.001)
        assert not region.holds(float(zeta), float(wn) * 0.9)
    assert not region.holds(0.3, 100.0)
    assert not np.any(so.pole_region(overshoot=0.0).wn_min)


def test_a_pole_is_read_back_as_its_pair() -> None:
    made = so.of_pole(complex(-0.6, 0.8) * 5)

    assert (made.zeta, made.wn) == pytest.approx((0.6, 5.0))
    assert made.phase == pytest.approx(so.phase_margin(0.6))
    for bad in (0.5 + 1j, complex("nan")):
        with pytest.raises(ValueError, match="a stable pole is needed"):
            so.of_pole(bad)


def test_impossible_specifications_are_refused_with_their_numbers() -> None:
    refusals: list[tuple[Callable[[], object], str]] = [
        (lambda: so.damping_for_overshoot(1.2), "within 0 and 1 of the step, got 1.2"),
        (lambda: so.damping_for_phase_margin(90), "the phase margin must lie within"),
        (lambda: so.overshoot(-0.1), "the damping ratio must lie within 0.01 and 20, got -0.1"),
        (lambda: so.settling_time(0.5, band=1.0), "the band must lie within"),
        (lambda: so.pole_region(settling=-1.0), "the settling time must be positive, got -1.0"),
        (lambda: so.second_order(0.5, 0.0), "the natural frequency must be positive"),
    ]
    for call, sentence in refusals:
        with pytest.raises(ValueError, match=sentence):
            call()
