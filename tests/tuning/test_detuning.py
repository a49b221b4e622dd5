"""The knob from calm to fast and its front."""

import numpy as np
import pytest

from loop.errors import RuleNotApplicable
from loop.process import FOPDT, TransferFunction
from tuning.detuning import detuned, front, peak_at

HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def test_along_the_front_robustness_is_traded_for_load_area() -> None:
    for structure in ("PI", "PID"):
        found = front(HEATER, structure=structure, points=3)
        peaks = [point.margins.Ms for point in found.points]
        assert peaks == pytest.approx([peak_at(knob) for knob in found.knob], rel=1e-3)
        assert np.all(np.diff([point.load_IAE for point in found.points]) < 0)


def test_names_are_positions() -> None:
    assert detuned(HEATER, "normal").pid == detuned(HEATER, 0.5).pid
    assert (peak_at(0.0), peak_at(1.0)) == (1.2, 2.0)
    assert peak_at(0.25) == pytest.approx(1.4)


def test_positions_without_settings_are_left_out() -> None:
    """A double integrator cannot be held at Ms 1.2 by a PID with N = 10."""
    double = TransferFunction((1.0,), (1.0, 0.0, 0.0), 1.0)
    found = front(double, structure="PID", points=3)
    assert found.knob[-1] == 1.0
    assert len(found.points) < 3
    with pytest.raises(RuleNotApplicable):
        front(double, structure="PI", points=2)


def test_impossible_positions_are_refused_in_words() -> None:
    with pytest.raises(ValueError, match=r"the knob must lie within 0 .* got 1\.5"):
        detuned(HEATER, 1.5)
    with pytest.raises(ValueError, match="one of calm, normal, fast"):
        detuned(HEATER, "wild")
    with pytest.raises(ValueError, match="at least 2 points"):
        front(HEATER, points=1)
