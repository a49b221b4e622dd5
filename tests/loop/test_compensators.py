import math

import numpy as np
import pytest

from loop.compensators import Lag, Lead, LeadLag, Notch, compensator_response, in_series
from loop.controller import PID
from loop.errors import UnstableLoop
from loop.frequency_curves import bandwidths, frequency_curves
from loop.margins import margins
from loop.process import FOPDT, TransferFunction

# 250/s^2 with a resonance at 503 rad/s, zeta .02: the anchor of the notch and the PD.
W = 503.0
RESONANCE = TransferFunction((250 * W**2,), (1.0, 2 * 0.02 * W, W**2, 0.0, 0.0))
NOTCH = Notch(w0=W, zeta_zero=0.05, zeta_pole=0.5)


def test_the_notch_is_as_deep_and_as_wide_as_its_curve_says() -> None:
    w = np.linspace(0.2 * W, 3 * W, 200_001)
    gain = np.abs(compensator_response([NOTCH], 1j * w))
    low = w[gain <= math.sqrt(0.5)]

    assert 20 * math.log10(NOTCH.depth) == pytest.approx(-20.0, abs=0.05)
    assert gain.min() == pytest.approx(NOTCH.depth, rel=1e-6)
    assert pytest.approx(0.99, abs=0.005) == NOTCH.width
    assert (low[-1] - low[0]) / W == pytest.approx(NOTCH.width, abs=2e-5)
    assert Notch(w0=1, zeta_zero=0.4, zeta_pole=0.5).width == 0.0


def test_a_resonance_with_notch_and_pd_crosses_over_where_the_anchor_says() -> None:
    process = in_series(RESONANCE, [NOTCH])
    slow, fast = (PID(Kc=Kp, Td=0.012, N=10) for Kp in (0.4, 23.9))

    assert bandwidths(process, slow).wc == pytest.approx(10.0, abs=0.05)
    assert margins(process, slow).phase == pytest.approx(5.8, abs=0.05)
    assert bandwidths(process, fast).wc == pytest.approx(100, abs=0.5)
    found = margins(process, fast)
    assert found.phase == pytest.approx(35.0, abs=0.05)
    assert 20 * math.log10(found.gain) == pytest.approx(12.9, abs=0.05)
    with pytest.raises(UnstableLoop):
        margins(RESONANCE, fast)


def test_a_lead_turns_most_where_it_says() -> None:
    lead = Lead(T=2.0, alpha=0.1)
    w = np.geomspace(0.01, 100, 20_001)
    phase = np.degrees(np.angle(compensator_response([lead], 1j * w)))

    assert phase.max() == pytest.approx(lead.largest_lead, abs=1e-5)
    assert w[phase.argmax()] == pytest.approx(lead.w_lead, rel=1e-3)
    assert abs(compensator_response([lead], np.array([1j * lead.w_lead]))[0]) == pytest.approx(
        1 / math.sqrt(0.1)
    )


def test_a_lag_multiplies_the_gain_at_low_frequency_only() -> None:
    response = np.abs(compensator_response([Lag(T=50.0, beta=4.0)], np.array([1e-7j, 1e5j])))

    np.testing.assert_allclose(response, [4.0, 1.0], rtol=1e-6)
    response = np.abs(compensator_response([LeadLag(T_lead=2, T_lag=8)], np.array([1e-7j, 1e5j])))
    np.testing.assert_allclose(response, [1.0, 0.25], rtol=1e-6)


def test_without_compensators_the_process_stays_itself() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)

    assert in_series(heater, ()) is heater
    # One that cancels itself leaves the margins as they are.
    there, back = LeadLag(T_lead=3, T_lag=7), LeadLag(T_lead=7, T_lag=3)
    pid = PID(Kc=0.45, Ti=135, Td=13.3)
    own, same = margins(heater, pid), margins(in_series(heater, [there, back]), pid)
    assert same.gain == pytest.approx(own.gain, rel=1e-9)
    assert same.Ms == pytest.approx(own.Ms, rel=1e-9)


def test_curves_put_the_compensator_on_the_controllers_side() -> None:
    w = np.array([1.0, 30.0, 400.0])
    pid = PID(Kc=0.4, Td=0.012, N=10)
    curves = frequency_curves(RESONANCE, pid, compensators=[NOTCH], w=w)
    s = 1j * w
    G = np.polyval(RESONANCE.numerator, s) / np.polyval(RESONANCE.denominator, s)
    C = 0.4 * (1 + 0.012 * s / (1 + 0.0012 * s)) * compensator_response([NOTCH], s)

    np.testing.assert_allclose(curves.L, G * C, rtol=1e-12)
    np.testing.assert_allclose(curves.S, 1 / (1 + G * C), rtol=1e-12)
    np.testing.assert_allclose(curves.T, G * C / (1 + G * C), rtol=1e-12)
    np.testing.assert_allclose(curves.GS, G / (1 + G * C), rtol=1e-12)
    np.testing.assert_allclose(curves.CS, C / (1 + G * C), rtol=1e-12)
    np.testing.assert_allclose(np.exp(1j * np.radians(curves.phase)), np.exp(1j * np.angle(G * C)))


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Lead(T=1, alpha=1.0), "alpha of a lead must lie within 1e-6 and 1, got 1.0"),
        (lambda: Lead(T=-1, alpha=0.1), "T must lie within 1e-09 and 1e\\+09 s, got -1"),
        (lambda: Lag(T=1, beta=1.0), "beta of a lag must lie within 1 and 1e6, got 1.0"),
        (lambda: LeadLag(T_lead=0, T_lag=1), "T_lead must lie within"),
        (lambda: Notch(w0=math.inf, zeta_zero=0.1, zeta_pole=0.5), "w0 must lie within"),
        (lambda: Notch(w0=1, zeta_zero=0.5, zeta_pole=0.5), "0 < zeta_zero < zeta_pole"),
    ],
)
def test_impossible_compensators_are_refused_in_words(make: object, sentence: str) -> None:
    assert callable(make)
    with pytest.raises(ValueError, match=sentence):
        make()
