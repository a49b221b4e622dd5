import math

import control
import numpy as np
import pytest

from loop.controller import PID, Action, controller_response
from loop.lti import controller_to_control, from_control, to_control
from loop.process import FOPDT, SOPDT, TransferFunction, rational_response

S = 1j * np.geomspace(1e-2, 1e2, 40)


def test_a_transfer_function_comes_back_as_it_went() -> None:
    there = TransferFunction((1, -2), (1, 2, 5, 0))
    assert from_control(to_control(there, pade_order=3)) == there
    assert from_control(control.tf([3], [2, 1]), theta=4) == TransferFunction((3,), (2, 1), 4)


# python-control 0.10 sets shapes of arrays, which numpy 2.5 warns of.
@pytest.mark.filterwarnings("ignore:Setting the shape:DeprecationWarning")
@pytest.mark.parametrize(
    ("n", "d"), [([1], [1, 2, 1]), ([1, 5, 3], [1, 2, 1]), ([2, 3], [1, 2, 4, 1e-3]), ([4], [2])]
)
def test_a_state_space_system_comes_over_with_its_relative_degree(
    n: list[float], d: list[float]
) -> None:
    found = from_control(control.ss(control.tf(n, d)))
    assert len(found.denominator) - len(found.numerator) == len(d) - len(n)
    expected = np.polyval(n, S) / np.polyval(d, S)
    np.testing.assert_allclose(rational_response(found, S), expected, rtol=1e-10)


def test_a_state_space_system_without_any_path_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="not all zero"):
        from_control(control.ss([[-1.0]], [[1.0]], [[0.0]], [[0.0]]))


def test_dead_time_goes_out_as_a_pade_approximation_of_the_stated_order() -> None:
    process = SOPDT(K=2, tau1=3, tau2=1, theta=0.5)
    exact = rational_response(process, S) * np.exp(-0.5 * S)
    slow = np.abs(S) < 6
    for order, error in ((2, 0.2), (4, 1e-2), (8, 1e-6)):
        response = to_control(process, pade_order=order)(S)
        assert np.max(np.abs(response / exact - 1)[slow]) < error
    assert len(to_control(process, pade_order=4).poles()) == 2 + 4


def test_a_controller_goes_out_with_its_sign() -> None:
    controller = PID(Kc=2, Ti=5, Td=1, tauF=0.2, action=Action.DIRECT)
    response = controller_to_control(controller)(S)
    np.testing.assert_allclose(response, controller_response(controller, S), rtol=1e-12)


def test_the_closed_loop_of_python_control_has_the_same_sensitivity() -> None:
    process, controller = FOPDT(K=2, tau=3, theta=0.5), PID(Kc=1, Ti=3)
    loop = to_control(process, pade_order=10) * controller_to_control(controller)
    L = rational_response(process, S) * np.exp(-0.5 * S) * controller_response(controller, S)
    slow = np.abs(S) < 10
    closed = control.feedback(1, loop)(S)
    np.testing.assert_allclose(closed[slow], (1 / (1 + L))[slow], rtol=1e-6)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.tf([1], [1, 0.5], 0.1), "discrete .*0.1"),
        (control.ss(-1, 1, 1, 0, True), "discrete"),
        (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "2 inputs and 2 outputs"),
        (control.tf([1, 0, 0], [1, 1]), "must be proper"),
    ],
)
def test_what_has_no_continuous_single_loop_form_is_refused_in_words(
    system: object, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        from_control(system)


def test_other_objects_are_refused_in_words() -> None:
    with pytest.raises(TypeError, match="needed, got FrequencyResponseData"):
        from_control(control.frd([1, 2], [1, 2]))


@pytest.mark.parametrize("order", [0, 13])
def test_an_order_without_sense_is_refused_in_words(order: int) -> None:
    with pytest.raises(ValueError, match=f"within 1 and 12, got {order}"):
        to_control(FOPDT(K=1, tau=1, theta=1), pade_order=order)


def test_an_infinite_filter_ratio_goes_out_improper() -> None:
    ideal = controller_to_control(PID(Kc=1, Td=1, N=math.inf))
    assert len(ideal.num[0][0]) == 2
    assert len(ideal.den[0][0]) == 1
