import math

import numpy as np
import pytest

from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, SOPDT, TransferFunction
from tuning.beyond_pid import BeyondPID, beyond_pid, relative_gains

HEATER = FOPDT(K=2, tau=120, theta=30)


def test_an_ordinary_loop_is_told_that_a_pid_is_enough() -> None:
    answer = beyond_pid(
        HEATER, load=5, allowed=4, op_room=40, set_point_change=20, relative_gain=1.1
    )

    assert answer.enough
    assert answer.findings == ()
    assert answer.sentence == "A PID is enough: nothing stated here asks for more."
    assert beyond_pid(IPDT(K=1, theta=9)).enough


@pytest.mark.parametrize(
    ("answer", "reason", "number"),
    [
        (beyond_pid(FOPDT(K=1, tau=10, theta=25)), "dead time dominates", 2.5),
        (beyond_pid(SOPDT(K=1, tau1=10, tau2=5, theta=15)), "dead time dominates", 1.5),
        (
            beyond_pid(TransferFunction((-2.0, 1.0), (1.0, 2.0, 1.0))),
            "PV first moves the wrong way",
            0.5 / math.sqrt(3),
        ),
        (
            beyond_pid(TransferFunction((1.0,), (10.0, -1.0), 9.0)),
            "the unstable process leaves no robust loop",
            math.exp(0.9),
        ),
        (beyond_pid(HEATER, relative_gain=-0.5), "the loops interact", -0.5),
        (beyond_pid(HEATER, relative_gain=0.4), "the loops interact", 0.4),
        (beyond_pid(HEATER, relative_gain=5.0), "the loops interact", 5.0),
        (beyond_pid(HEATER, relative_gain=0.0), "the loops interact", 0.0),
        (
            beyond_pid(HEATER, load=10, allowed=3),
            "the load is faster than the dead time",
            20 * (1 - math.exp(-0.25)),
        ),
        (beyond_pid(HEATER, load=30, op_room=20), "the output runs into its limit", 30.0),
        (
            beyond_pid(HEATER, set_point_change=50, op_room=20),
            "the output runs into its limit",
            25.0,
        ),
    ],
)
def test_every_reason_comes_with_its_number_and_with_what_helps(
    answer: BeyondPID, reason: str, number: float
) -> None:
    (found,) = answer.findings
    assert not answer.enough
    assert found.reason == reason
    assert found.number == pytest.approx(number)
    assert found.helps
    assert f"{found.number:.3g}" in answer.sentence


def test_relative_gains_are_those_of_the_two_by_two_formula() -> None:
    K = np.array([[2.0, 1.5], [1.0, 2.0]])
    found = relative_gains(K)
    gain = 1 / (1 - K[0, 1] * K[1, 0] / (K[0, 0] * K[1, 1]))

    np.testing.assert_allclose(found, [[gain, 1 - gain], [1 - gain, gain]])
    # The units of rows and columns do not matter, and every row and column adds up to 1.
    scaled = np.diag([7.0, 0.01]) @ K @ np.diag([3.0, 1e4])
    np.testing.assert_allclose(relative_gains(scaled), found)
    rng = np.random.default_rng(1)
    three = relative_gains(rng.normal(size=(3, 3)))
    np.testing.assert_allclose(three.sum(axis=0), 1.0)
    np.testing.assert_allclose(three.sum(axis=1), 1.0)


def test_what_has_no_answer_is_refused_in_words() -> None:
    with pytest.raises(RuleNotApplicable, match="the gain matrix is singular"):
        relative_gains(np.array([[1.0, 2.0], [2.0, 4.0]]))
    with pytest.raises(RuleNotApplicable, match="singular"):
        relative_gains(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="a square matrix of finite numbers"):
        relative_gains(np.ones((2, 3)))
    with pytest.raises(ValueError, match="op_room must be positive, got -1"):
        beyond_pid(HEATER, op_room=-1)
    with pytest.raises(ValueError, match="the relative gain must be finite"):
        beyond_pid(HEATER, relative_gain=math.nan)
