"""Optimal PI where it differs from the printed table, by brute force without code of the search.

The bound on Kc comes from |1 + L|^2 as a quadratic in Kc at 40,001 frequencies, the areas from a
simulation: the lag exact for an input between two samples on a line, extrapolated in the step.
"""

import numpy as np
import pytest

from loop.process import FOPDT
from loop.signals import Real
from tuning.loop_limits import LoopLimits
from tuning.optimal import optimal

MS = 1.59
# tau; the table's references, Kc, Ti and J; J at its settings, and how far J falls below that.
ROWS = (
    (0.001, (1.6099, 1.6099), (0.1993, 0.3209, 1.0000), 1.0001, 5e-5),
    (1.0, (2.0804, 2.0201), (0.5450, 1.1169, 1.0072), 1.0061, 5e-4),
    (8.0, (2.1832, 1.1346), (3.4735, 4.0430, 1.2240), 1.2223, -1e-5),
    (20.0, (2.1799, 0.6009), (8.3376, 5.0374, 1.3574), 1.3557, 1.2e-3),
)


def loop_gain(tau: float, Ti: float) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    """Loop of Kc = 1 around e^(-s)/(tau s + 1), on a dense grid."""
    s = 1j * np.geomspace(0.03, 8, 40_001)
    return np.asarray((1 + 1 / (Ti * s)) * np.exp(-s) / (tau * s + 1))


def largest_gain(tau: float, Ti: float) -> float:
    """Smallest Kc at which |1 + L| = 1/Ms anywhere."""
    g = loop_gain(tau, Ti)
    square, half = np.abs(g) ** 2, g.real
    rest = half**2 - square * (1 - 1 / MS**2)
    reached = (rest >= 0) & (half < 0)
    return float(np.min((-half[reached] - np.sqrt(rest[reached])) / square[reached]))


def absolute_areas(tau: float, Kc: Real, Ti: Real, steps: int) -> Real:
    """IAE after unit steps at the output (first row) and at the input of the process."""
    h, z = 1 / steps, 1 / (steps * tau)
    decay, now = np.exp(-z), 1 + np.expm1(-z) / z
    before = -np.expm1(-z) - now
    step_out, step_in = np.array([[1.0], [0.0]]), np.array([[0.0], [1.0]])
    y = integral = area = np.zeros((2, Kc.size))
    e = y - step_out
    waiting = [y] * steps + [Kc * e + step_in]
    for k in range(int(40 + 2 * tau) * steps):
        # The jump at time 0 arrives after one dead time; until then the input is nothing.
        arriving = y * 0 if k + 1 == steps else waiting[k + 1]
        y = decay * y + before * waiting[k] + now * arriving
        after = -y - step_out
        integral = integral + 0.5 * h * (e + after)
        waiting.append(Kc * (after + integral / Ti) + step_in)
        size = np.abs(e) + np.abs(after)
        crossed = (e**2 + after**2) / (2 * np.maximum(size, 1e-300))
        area = area + h * np.where(e * after < 0, crossed, 0.5 * size)
        e = after
    return np.asarray(area)


@pytest.mark.parametrize(("tau", "references", "table", "its_J", "gain"), ROWS)
def test_no_integral_time_is_better_and_where_the_table_is_missed_its_own_is_worse(
    tau: float,
    references: tuple[float, float],
    table: tuple[float, float, float],
    its_J: float,
    gain: float,
) -> None:
    found = optimal(
        FOPDT(K=1.0, tau=tau, theta=1.0),
        LoopLimits(Ms=MS),
        objective="trade-off",
        references=references,
    )
    Kc, Ti = found.pid.Kc, found.pid.Ti
    # The limit is reached and kept.
    Ms = float(np.max(1 / np.abs(1 + Kc * loop_gain(tau, Ti))))
    assert MS - 1e-5 < Ms < MS + 1e-6
    # Kc of the table is the largest at its Ti too, to its digits.
    assert table[0] == pytest.approx(largest_gain(tau, table[1]), rel=2e-4)
    times = Ti * np.linspace(0.88, 1.12, 17)
    gains = np.array([largest_gain(tau, float(time)) for time in times])
    Kcs, Tis = np.append(gains, [Kc, table[0]]), np.append(times, [Ti, table[1]])
    coarse, fine = (absolute_areas(tau, Kcs, Tis, steps) for steps in (25, 50))
    areas = (4 * fine - coarse) / 3
    J = 0.5 * (areas[0] / references[0] + areas[1] / references[1])
    assert J[-1] == pytest.approx(its_J, abs=1e-4)
    assert J[-2] == pytest.approx(found.value, abs=1e-4)
    # Of all Ti within 12 % none is better, and the table's is worse.
    assert J[-2] < J[:-2].min() + 1e-5
    assert J[-1] - J[-2] > gain
