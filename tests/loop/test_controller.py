"""Controller forms against their own transfer functions (second route: the formula as printed)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from loop.controller import PID, Action, ParallelPID, SeriesPID, controller_response
from loop.errors import ConversionRefused

W = 1j * np.geomspace(1e-4, 1e3, 60)
gains = st.floats(1e-3, 1e3)
times = st.floats(1e-2, 1e4)


@given(Kc=gains, Ti=times, Td=times, N=st.floats(1, 50))
def test_the_polynomials_are_the_printed_isa_formula(
    Kc: float, Ti: float, Td: float, N: float
) -> None:
    printed = Kc * (1 + 1 / (Ti * W) + Td * W / (1 + Td * W / N))
    found = controller_response(PID(Kc=Kc, Ti=Ti, Td=Td, N=N), W)
    np.testing.assert_allclose(found, printed, rtol=1e-9)


def test_the_lag_stands_in_series_and_the_direct_action_turns_the_sign() -> None:
    plain = controller_response(PID(Kc=0.45, Ti=135, Td=13.3), W)
    lagged = controller_response(PID(Kc=0.45, Ti=135, Td=13.3, tauF=12, action=Action.DIRECT), W)
    np.testing.assert_allclose(lagged, -plain / (12 * W + 1), rtol=1e-12)


@given(Kc=gains, Ti=times, ratio=st.floats(0, 1), alpha=st.floats(0, 0.5))
def test_series_goes_to_isa_and_back(Kc: float, Ti: float, ratio: float, alpha: float) -> None:
    series = SeriesPID(Kc=Kc, Ti=Ti, Td=ratio * Ti, alpha=alpha if ratio > 0.01 else 0.1)
    printed = Kc * (1 + 1 / (Ti * W)) * (series.Td * W + 1) / (series.alpha * series.Td * W + 1)
    try:
        isa = series.to_isa()
    except ConversionRefused:
        Tf = series.alpha * series.Td
        assert Ti * series.Td / (Ti + series.Td - Tf) < Tf
        return
    np.testing.assert_allclose(controller_response(isa, W), printed, rtol=1e-6)
    if isa.Td > 0:
        back = SeriesPID.from_isa(isa)
        assert (back.Kc, back.Ti, back.Td) == pytest.approx((Kc, Ti, series.Td), rel=1e-4)


def test_the_filter_moves_the_series_form_by_more_than_a_tenth() -> None:
    """Ti' 50, Td' 10, alpha .1: the filter-less formulas are 12-32 % off (facts.md section 1)."""
    exact = SeriesPID(Kc=1, Ti=50, Td=10, alpha=0.1).to_isa()
    careless = PID(Kc=1.2, Ti=60, Td=10 / 1.2, N=10)
    error = np.abs(controller_response(careless, W) / controller_response(exact, W) - 1)
    assert 0.12 <= error.max() <= 0.32


def test_isa_has_a_series_form_only_for_ti_of_four_td_or_more() -> None:
    at_limit = SeriesPID.from_isa(PID(Kc=2, Ti=40, Td=10, N=math.inf))
    assert (at_limit.Ti, at_limit.Td, at_limit.Kc) == pytest.approx((20, 20, 1))
    with pytest.raises(ConversionRefused, match="too short"):
        SeriesPID.from_isa(PID(Kc=2, Ti=39.9, Td=10, N=math.inf))


@given(Kp=gains, Ki=st.floats(0, 1e2), Kd=st.floats(0, 1e2))
def test_parallel_round_trip(Kp: float, Ki: float, Kd: float) -> None:
    Ki = Ki if Ki > 1e-3 else 0.0
    Kd = Kd if Kd > 1e-3 else 0.0
    parallel = ParallelPID(Kp=Kp, Ki=Ki, Kd=Kd, Tf=0.01 if Kd else 0.0)
    isa = parallel.to_isa()
    printed = Kp + Ki / W + Kd * W / (parallel.Tf * W + 1)
    np.testing.assert_allclose(controller_response(isa, W), printed, rtol=1e-9)
    back = ParallelPID.from_isa(isa)
    assert (back.Kp, back.Ki, back.Kd, back.Tf) == pytest.approx((Kp, Ki, Kd, parallel.Tf))


def test_pure_integral_control_has_no_isa_form() -> None:
    with pytest.raises(ConversionRefused, match="proportional"):
        ParallelPID(Kp=0, Ki=1).to_isa()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"Kc": -1.0}, "direct action"),
        ({"Kc": math.nan}, "Kc must lie"),
        ({"Kc": 1.0, "Ti": 0.0}, "Ti must be infinite or"),
        ({"Kc": 1.0, "Td": -1.0}, "Td must lie"),
        ({"Kc": 1.0, "Td": math.inf}, "Td must lie"),
        ({"Kc": 1.0, "N": 0.0}, "N must be positive"),
        ({"Kc": 1.0, "b": -0.1}, "b must lie"),
    ],
)
def test_impossible_settings_are_refused_in_words(settings: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PID(**settings)


def test_the_structure_names_the_terms_in_use() -> None:
    assert PID(Kc=1).structure == "P"
    assert PID(Kc=1, Ti=5).structure == "PI"
    assert PID(Kc=1, Td=5).structure == "PD"
    assert PID(Kc=1, Ti=5, Td=1).structure == "PID"
