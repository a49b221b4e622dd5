"""What bad sensors show, by hand and inside a loop."""

import numpy as np
import pytest

from loop.controller import PID
from loop.process import FOPDT
from loop.sensor_faults import (
    Biased,
    Clipped,
    Frozen,
    Quantised,
    SensorFault,
    Spiked,
    shown_values,
)
from loop.simulation import simulate
from loop.simulation_batch import simulate_batch

T = np.arange(8.0)
PV = np.array([1.0, 2, 4, 7, 11, 16, 22, 29])
HEATER = FOPDT(K=2, tau=20, theta=5)
PI = PID(Kc=0.8, Ti=20)


@pytest.mark.parametrize(
    ("fault", "shown"),
    [
        (Frozen(start=3, end=6), [1, 2, 4, 4, 4, 4, 22, 29]),
        (Frozen(start=0), [1] * 8),
        (Biased(size=3, start=2), [1, 2, 7, 10, 14, 19, 25, 32]),
        (Biased(rate=-1, start=2, end=5), [1, 2, 4, 6, 9, 16, 22, 29]),
        (Clipped(high=10), [1, 2, 4, 7, 10, 10, 10, 10]),
        (Clipped(low=3, high=20), [3, 3, 4, 7, 11, 16, 20, 20]),
        (Quantised(step=5), [0, 0, 5, 5, 10, 15, 20, 30]),
        (Spiked(size=100, share=0), PV),
    ],
)
def test_a_fault_shows_what_its_name_says(fault: SensorFault, shown: list[float]) -> None:
    assert shown_values(T, PV, [fault]).tolist() == list(shown)
    both = shown_values(T, np.stack([PV, PV + 1], axis=1), [fault])
    assert both[:, 0].tolist() == list(shown)


def test_faults_add_up_in_their_order() -> None:
    faults = [Biased(size=10), Clipped(high=15)]
    assert shown_values(T, PV, faults).tolist() == [11, 12, 14, 15, 15, 15, 15, 15]
    assert shown_values(T, PV, faults[::-1]).tolist() == [11, 12, 14, 17, 21, 25, 25, 25]


def test_spikes_fall_on_their_share_of_the_scans_up_and_down() -> None:
    t = np.arange(5_000.0)
    shown = shown_values(t, np.zeros((t.size, 2)), [Spiked(size=3, share=0.02, seed=5)])
    assert set(np.unique(shown)) == {-3.0, 0.0, 3.0}
    # A share of 0.02 of 10,000 values: 200 +- 14, and as many up as down within 14.
    assert np.count_nonzero(shown) == pytest.approx(200, abs=4 * 14)
    assert shown.sum() / 3 == pytest.approx(0, abs=4 * 14)
    assert np.count_nonzero(shown.all(axis=1)) < 15  # 0.0004 of 5,000 is 2
    again = shown_values(t, np.zeros((t.size, 2)), [Spiked(size=3, share=0.02, seed=5)])
    assert np.array_equal(shown, again)


def test_a_biased_sensor_moves_the_plant_and_not_the_reading() -> None:
    run = simulate(HEATER, PI, t_end=600, dt=1, sp=50.0, pv0=50, faults=[Biased(size=2, start=50)])
    assert run.pv[-1] == pytest.approx(50, abs=1e-6)
    assert run.true_pv[-1] == pytest.approx(48, abs=1e-6)
    assert run.true_pv[49] == 50


def test_a_frozen_sensor_drives_the_integral_on() -> None:
    """The error stays, so the output moves by Kc e dt/Ti a scan."""
    run = simulate(
        HEATER, PI, t_end=200, dt=1, sp=1.0, faults=[Frozen(start=0)], pv0=0.0, noise=0.0
    )
    assert np.all(run.pv == 0)
    np.testing.assert_allclose(np.diff(run.op), 0.8 / 20, atol=1e-12)
    assert run.true_pv[-1] > 10


@pytest.mark.parametrize(
    "fault",
    [Frozen(start=30, end=60), Biased(size=0.2, rate=0.01), Clipped(high=0.8), Quantised(step=0.1)],
)
def test_a_batch_sees_what_its_loops_see(fault: SensorFault) -> None:
    pids = [PI, PID(Kc=0.4, Ti=30, Td=2)]
    batch = simulate_batch([HEATER], pids, t_end=100, dt=1, sp=1.0, pv0=0.3, faults=[fault])
    for i, pid in enumerate(pids):
        one = simulate(HEATER, pid, t_end=100, dt=1, sp=1.0, pv0=0.3, faults=[fault])
        np.testing.assert_allclose(batch.pv[:, i], one.pv, atol=1e-12)
        np.testing.assert_allclose(batch.op[:, i], one.op, atol=1e-12)
        assert not np.array_equal(one.pv, one.true_pv)


def test_impossible_faults_are_refused() -> None:
    with pytest.raises(ValueError, match="must start at 0 or later and end later, got 5 to 5 s"):
        Frozen(start=5, end=5)
    with pytest.raises(ValueError, match="must start at 0"):
        Biased(size=1, start=-1)
    with pytest.raises(ValueError, match="size and rate must be finite"):
        Biased(size=float("nan"))
    with pytest.raises(ValueError, match="size must be positive"):
        Spiked(size=0, share=0.1)
    with pytest.raises(ValueError, match="share must lie within 0 and 1"):
        Spiked(size=1, share=1.5)
    with pytest.raises(ValueError, match="low must be below high"):
        Clipped(low=2, high=1)
    with pytest.raises(ValueError, match="step must be positive"):
        Quantised(step=0)
    with pytest.raises(ValueError, match="equally long"):
        shown_values(T, PV[:3], [])
