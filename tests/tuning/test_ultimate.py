"""The ultimate point against the Nyquist condition and printed anchors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from loop.controller import Action
from loop.errors import RuleNotApplicable
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    TransferFunction,
    rational_response,
)
from tuning.ultimate import UltimatePoint, ultimate_point

times = st.floats(1e-3, 1e3)


def test_the_heater_oscillates_at_its_printed_gain_and_period() -> None:
    point = ultimate_point(FOPDT(K=2.0, tau=120.0, theta=30.0))
    assert point.Ku == pytest.approx(3.467, abs=5e-4)
    assert point.Pu == pytest.approx(109.9, abs=0.05)
    assert point.source == "exact"


@given(
    process=st.one_of(
        st.builds(lambda tau, theta: FOPDT(K=-3.0, tau=tau, theta=theta), times, times),
        st.builds(
            lambda a, b, theta: SOPDT(K=3.0, tau1=max(a, b), tau2=min(a, b), theta=theta),
            times,
            times,
            times,
        ),
        st.builds(lambda theta: IPDT(K=0.3, theta=theta), times),
    )
)
def test_the_loop_passes_through_minus_one_and_at_no_lower_frequency(process: Process) -> None:
    """Second route: the Nyquist condition Ku G(j w) = -1, evaluated from the model itself."""
    point = ultimate_point(process)

    def phase_and_size(w: float) -> complex:
        s = np.array([1j * w])
        G = rational_response(process, s) * np.exp(-process.theta * s)
        return complex(point.Ku * point.action.sign * G[0])

    w180 = 2 * math.pi / point.Pu
    assert phase_and_size(w180) == pytest.approx(-1, abs=1e-6)
    below = [phase_and_size(w) for w in np.linspace(0.02, 0.98, 25) * w180]
    assert all(L.imag < 0 for L in below)  # the phase has not yet reached -180°


def test_an_integrator_with_dead_time_has_a_closed_form() -> None:
    point = ultimate_point(IPDT(K=0.5, theta=2.0))
    assert (point.Ku, point.Pu) == pytest.approx((math.pi / 2 / (0.5 * 2.0), 4 * 2.0))


@pytest.mark.parametrize(
    ("process", "reason"),
    [
        (FOPDT(K=1, tau=1, theta=0), "never reaches"),
        (SOPDT(K=1, tau1=2, tau2=1, theta=0), "never reaches"),
        (IPDT(K=1, theta=0), "never reaches"),
        (DoubleIntegrator(K=1, theta=1), "not for DoubleIntegrator"),
        (TransferFunction((1,), (1, 1)), "not for TransferFunction"),
    ],
)
def test_a_process_without_an_ultimate_point_is_refused(process: Process, reason: str) -> None:
    with pytest.raises(RuleNotApplicable, match=reason):
        ultimate_point(process)


def test_a_negative_gain_oscillates_under_direct_action() -> None:
    assert ultimate_point(FOPDT(K=-2.0, tau=120.0, theta=30.0)).action is Action.DIRECT


@pytest.mark.parametrize(("Ku", "Pu"), [(0.0, 1.0), (1.0, -1.0), (math.inf, 1.0), (1.0, math.nan)])
def test_an_impossible_ultimate_point_is_refused(Ku: float, Pu: float) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        UltimatePoint(Ku=Ku, Pu=Pu)
