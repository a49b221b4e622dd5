"""Transfer entropy: closed forms, the definition counted out, and signals that tell nothing."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter
from scipy.special import digamma

from loop.signals import Real
from monitoring.granger import granger
from monitoring.transfer_entropy import NEIGHBOURS, SHIFTS, _Neighbours, transfer_entropy

N = 2000
# Three standard deviations of an estimate from 1,000 rows where there is nothing: 0.008 in 40 runs.
NEAR = 0.025


def linear_pair(coupling: float, *, seed: int = 1, n: int = N) -> tuple[Real, Real]:
    """x remembers itself and drives y, which does too."""
    e, f = np.random.default_rng(seed).normal(size=(2, n))
    x = lfilter([1.0], [1.0, -0.6], e)
    return x, np.asarray(lfilter([1.0], [1.0, -0.7], f + coupling * np.roll(x, 1)))


def squared_pair(*, seed: int = 2, n: int = N) -> tuple[Real, Real]:
    """The square of x, two samples later, drives y: no correlation at any lag."""
    x, e = np.random.default_rng(seed).normal(size=(2, n))
    return x, np.asarray(lfilter([1.0], [1.0, -0.5], e + 0.6 * np.roll(x, 2) ** 2))


def exact(coupling: float) -> float:
    """Half the log of the variances by which y is predicted from itself, and from x too.

    The first is that of the Kalman filter which sees y alone, by the Riccati equation.
    """
    A = np.array([[0.6, 0.0], [coupling, 0.7]])
    P = solve_discrete_are(A.T, np.array([[0.0], [1.0]]), np.eye(2), np.array([[1e-9]]))
    return 0.5 * float(np.log(P[1, 1]))


@pytest.mark.parametrize("coupling", [0.3, 0.8])
def test_of_linear_gaussian_signals_it_is_half_the_log_ratio_of_granger(coupling: float) -> None:
    """Means of four runs; of 40 the mean was 4 % below at 0.3 and 12 % below at 0.8.

    Their standard deviations were 0.014 and 0.020, so that a mean of four is within 0.02 or 0.03 of
    that; 20 neighbours blur a strong link.
    """
    pairs = [linear_pair(coupling, seed=seed) for seed in range(4)]
    there = [transfer_entropy(x, y) for x, y in pairs]
    back = [transfer_entropy(y, x) for x, y in pairs]
    mean = np.mean([one.value for one in there if one.value is not None])
    halves = [granger(np.array(pair)).arrows[0].strength / 2 for pair in pairs]
    assert mean == pytest.approx(exact(coupling), rel=0.2)
    assert mean == pytest.approx(np.mean(halves), rel=0.2)
    assert all((one.delay, one.significant) == (1, True) for one in there)
    assert all(one.p_value == 1 / (SHIFTS + 1) for one in there)
    assert not any(one.significant for one in back)


def test_a_link_without_correlation_is_seen_where_granger_sees_none() -> None:
    x, y = squared_pair()
    assert not any(arrow.significant for arrow in granger(np.array([x, y])).arrows)
    there, back = transfer_entropy(x, y), transfer_entropy(y, x)
    assert (there.delay, there.significant) == (2, True)
    assert not back.significant


def test_neighbours_are_counted_as_in_the_definition() -> None:
    """Point by point, with plain loops."""
    x, y, z, w = np.random.default_rng(3).normal(size=(4, 120))
    y = y + 0.5 * x * z
    past = np.column_stack([z, w])
    total = 0.0
    for i in range(120):
        of_past = np.max(np.abs(past - past[i]), axis=1)
        of_x, of_y = np.abs(x - x[i]), np.abs(y - y[i])
        # The point itself is the nearest of all.
        reach = np.sort(np.maximum(np.maximum(of_x, of_y), of_past))[NEIGHBOURS]
        n_z, n_xz, n_yz = (
            np.sum(apart < reach)
            for apart in (of_past, np.maximum(of_x, of_past), np.maximum(of_y, of_past))
        )
        total += digamma(n_z) - digamma(n_xz) - digamma(n_yz)
    expected = digamma(NEIGHBOURS) + total / 120
    assert _Neighbours(y, past).information(x) == pytest.approx(expected, rel=1e-12)


def test_monotone_scales_change_no_digit() -> None:
    x, y = squared_pair(n=600)
    plain = transfer_entropy(x, y)
    assert transfer_entropy(np.exp(2 * x) - 5.0, 1e3 * np.arctan(y)) == plain


def test_a_third_loop_that_drives_both_is_allowed_for() -> None:
    e, f, g = np.random.default_rng(4).normal(size=(3, N))
    z = lfilter([1.0], [1.0, -0.7], e)
    x = lfilter([1.0], [1.0, -0.5], np.roll(z, 1) + 0.5 * f)
    y = lfilter([1.0], [1.0, -0.5], np.roll(z, 3) + 0.5 * g)
    assert transfer_entropy(x, y).significant
    assert not transfer_entropy(x, y, given=[z]).significant
    assert transfer_entropy(z, y, given=[x]).significant


def test_by_chance_one_independent_pair_in_twenty_has_a_p_value_of_a_twentieth() -> None:
    """Resonances of one period: of 30 pairs 1.5 are expected, more than 6 in one of 1,000 tests."""
    rng = np.random.default_rng(5)
    b, a = [1.0], [1.0, -2 * 0.98 * np.cos(2 * np.pi / 20), 0.98**2]
    pairs = [lfilter(b, a, rng.normal(size=(2, 700)))[:, 300:] for _ in range(30)]
    found = [transfer_entropy(x, y) for x, y in pairs]
    assert sum(one.p_value is not None and one.p_value <= 0.05 for one in found) <= 6
    assert sum(one.significant for one in found) <= 1


def test_equal_values_are_no_information() -> None:
    """Rounded to a tenth of their range, independent signals still tell nothing of each other."""
    x, y = np.random.default_rng(6).normal(size=(2, 600))
    found = transfer_entropy(np.round(2 * x), np.round(2 * y))
    assert found.value == pytest.approx(0.0, abs=NEAR)
    assert not found.significant


@pytest.mark.parametrize(
    ("cause", "effect", "reason"),
    [
        (np.ones(500), np.arange(500.0), "signal 1 does not move"),
        (np.arange(3.0), np.arange(3.0), "3 samples are fewer than 212"),
        (np.arange(150.0), np.sin(np.arange(150.0)), "150 samples are fewer than 212"),
    ],
)
def test_what_cannot_be_measured_says_why(cause: Real, effect: Real, reason: str) -> None:
    found = transfer_entropy(cause, effect)
    assert found.value is None
    assert found.p_value is None
    assert not found.significant
    assert reason in found.reason


def test_gaps_different_lengths_and_too_many_others_are_refused() -> None:
    with pytest.raises(ValueError, match="finite numbers of one length"):
        transfer_entropy(np.array([1.0, np.nan]), np.ones(2))
    with pytest.raises(ValueError, match="finite numbers of one length"):
        transfer_entropy(np.ones(3), np.ones(2))
    with pytest.raises(ValueError, match="at most 2 signals"):
        transfer_entropy(np.ones(3), np.ones(3), given=[np.ones(3)] * 3)
