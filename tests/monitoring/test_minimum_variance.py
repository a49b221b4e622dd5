import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import t as student

from loop.controller import PID
from loop.experiment import Step
from loop.process import FOPDT
from loop.signals import Real
from loop.simulation import simulate
from monitoring.basis import Confidence
from monitoring.load_responses import load_responses, smoothed, smoothed_steps
from monitoring.loop_signals import Stretch
from monitoring.minimum_variance import Estimator, minimum_variance


def closed_loop(K: float, n: int, seed: int = 0) -> Real:
    """y = u(t-2) + (1 - .2/q)/(1 - 1/q) a under du = -K y: y = (1 - .2/q) a/(1 - 1/q + K/q^2)."""
    a = np.random.default_rng(seed).normal(size=n + 500)
    return np.asarray(lfilter([1, -0.2], [1, -1, K], a)[500:])


def lagged_products(row: Real, lags: int) -> list[float]:
    return [float(row[k:] @ row[: row.size - k]) / row.size for k in range(lags)]


@pytest.mark.parametrize("delay", [5, 150])
def test_long_records_rest_on_the_products_within_eight_blocks(delay: int) -> None:
    white = np.random.default_rng(7).normal(size=80_000)
    error = np.asarray(lfilter([1.0], [1.0, -0.99], white))
    blocks = (error - error.mean()).reshape(8, -1)
    r = np.mean([lagged_products(block, delay + 20) for block in blocks], axis=0)
    right = r[delay:]
    expected = 1 - right @ solve_toeplitz(r[:20], right) / r[0]
    assert minimum_variance(error, delay=delay).eta == pytest.approx(expected, rel=1e-6)


def test_the_variance_counts_the_samples_behind_the_last_block_too() -> None:
    error = 50 + closed_loop(0.3, 20_007)
    error[-7:] += 30
    found = minimum_variance(error, delay=3)
    assert found.eta is not None
    assert found.minimum_variance == pytest.approx(found.eta * np.var(error), rel=1e-9)


@pytest.mark.parametrize(
    ("K", "index"), [(0.1, 0.4166), (0.3, 0.8321), (0.5, 0.8836), (0.8, 0.4991)]
)
@pytest.mark.parametrize("n", [4000, 60_000])
def test_the_example_with_a_closed_form_is_met(K: float, index: float, n: int) -> None:
    found = minimum_variance(closed_loop(K, n, seed=1), delay=2)
    assert found.eta == pytest.approx(index, abs=0.02)
    assert found.minimum_variance == pytest.approx(1.64, rel=0.06)
    assert found.low is not None
    assert found.high is not None
    assert found.low < index < found.high
    assert (found.delay, found.order) == (2, 20)
    assert found.comparable
    assert not found.extended


def test_both_estimators_say_the_same() -> None:
    y = closed_loop(0.3, 5000)
    fast = minimum_variance(y, delay=2)
    slow = minimum_variance(y[:4999], delay=2)
    assert (fast.estimator, slow.estimator) == (Estimator.AUTOCORRELATION, Estimator.LEAST_SQUARES)
    assert fast.eta == pytest.approx(slow.eta, abs=0.003)


def test_a_gap_is_left_out_and_not_bridged() -> None:
    y = closed_loop(0.3, 4000)
    y[1000:1200] = np.nan
    assert minimum_variance(y, delay=2).eta == pytest.approx(0.8321, abs=0.03)


def test_too_long_a_delay_raises_the_index() -> None:
    y = closed_loop(0.1, 20_000)
    right, wrong = (minimum_variance(y, delay=b).eta for b in (2, 7))
    assert right is not None
    assert wrong is not None
    assert wrong > 1.3 * right


def test_an_unknown_delay_extends_the_horizon_and_says_so() -> None:
    for n in (4000, 20_000):
        found = minimum_variance(closed_loop(0.3, n), delay=None)
        assert found.extended
        assert found.delay > 2
        assert found.eta is not None
        assert found.eta > 0.83
        assert found.basis.confidence is Confidence.MEDIUM


def test_marks_keep_the_index_out_of_a_ranking() -> None:
    found = minimum_variance(closed_loop(0.3, 4000), delay=2, marks=("the valve sticks",))
    assert not found.comparable
    assert "the valve sticks" in found.basis.reasons


def test_what_cannot_be_estimated_is_refused() -> None:
    assert minimum_variance(np.arange(100.0), delay=2).basis.refused
    assert minimum_variance(np.ones(1000), delay=2).eta is None
    assert minimum_variance(np.ones(9000), delay=2).eta is None
    assert minimum_variance(np.ones(9000), delay=None).eta is None
    assert minimum_variance(closed_loop(0.3, 400), delay=2).low is None
    half_flat = np.r_[closed_loop(0.3, 400), np.ones(6000)]
    assert minimum_variance(half_flat, delay=2).eta is not None
    with pytest.raises(ValueError, match="delay must be at least one"):
        minimum_variance(np.ones(10), delay=0)
    with pytest.raises(ValueError, match="order must be at least 1"):
        minimum_variance(np.ones(10), delay=1, order=0)


def loaded(Kc: float, Ti: float, *, K: float = 1.0, with_sp: bool = True) -> Stretch:
    """Load steps far apart under a slow, fair or lively PI."""
    n = 6000
    load = 5.0 * ((np.arange(n) // 600) % 2)
    process = FOPDT(K=K, tau=20, theta=5)
    action = PID(Kc=Kc, Ti=Ti).action if K > 0 else PID(Kc=Kc, Ti=Ti).action.for_gain(K)
    run = simulate(
        process, PID(Kc=Kc, Ti=Ti, action=action), t_end=n - 1.0, dt=1.0, load=load,
        sp=Step(size=2.0, at=300.0), noise=0.01, rng=np.random.default_rng(0),
    )  # fmt: skip
    return Stretch(first=0, dt=1.0, pv=run.pv, op=run.op, sp=run.sp if with_sp else None, share=1.0)


@pytest.mark.parametrize("K", [1.0, -1.0])
def test_a_sluggish_loop_has_an_idle_index_near_one(K: float) -> None:
    slow = load_responses(loaded(0.3, 20.0, K=K))
    fair = load_responses(loaded(2.0, 20.0, K=K))
    assert slow.idle_index is not None
    assert fair.idle_index is not None
    assert slow.sluggish
    assert not fair.sluggish
    assert slow.idle_index > fair.idle_index + 0.3
    sign = 1 if K > 0 else -1
    assert load_responses(loaded(0.3, 20.0, K=K), gain_sign=sign).idle_index == slow.idle_index


def test_an_output_that_swings_has_a_small_area_index() -> None:
    calm, lively = load_responses(loaded(1.5, 25.0)), load_responses(loaded(4.6, 12.0))
    assert calm.area_index is not None
    assert lively.area_index is not None
    assert calm.area_index > 0.9
    assert not calm.swinging
    assert lively.area_index < 0.35
    assert lively.swinging


def test_without_clear_load_responses_there_is_no_index() -> None:
    n = 600
    flat = Stretch(first=0, dt=1.0, pv=np.zeros(n), op=np.zeros(n), sp=None, share=1.0)
    found = load_responses(flat)
    assert found.basis.refused
    assert found.responses == 0
    assert load_responses(loaded(2.0, 20.0, with_sp=False)).responses >= 3


@pytest.mark.parametrize("width", [1, 3, 4, 11, 500])
@pytest.mark.parametrize("n", [4, 12, 57])
def test_the_steps_of_a_moving_mean_need_no_sum(n: int, width: int) -> None:
    signal = np.random.default_rng(n).normal(size=n).cumsum()
    np.testing.assert_allclose(
        smoothed_steps(signal, width), np.diff(smoothed(signal, width)), atol=1e-13
    )


def test_the_interval_is_that_of_student_for_its_blocks_and_a_little_wider() -> None:
    y = closed_loop(0.5, 1500, seed=3)
    parts = [minimum_variance(part, delay=2).eta for part in np.array_split(y, 4)]
    found = minimum_variance(y, delay=2)
    assert found.eta is not None
    assert found.low is not None
    half = 1.18 * student.ppf(0.975, 3) * np.std(np.array(parts, dtype=float), ddof=1) / 2
    assert found.eta - found.low == pytest.approx(half, rel=1e-3)
