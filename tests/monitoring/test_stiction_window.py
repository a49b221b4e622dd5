import numpy as np

from monitoring.stiction_search import MOST_CYCLES, stiction_search


def test_a_day_is_searched_in_its_last_twenty_cycles() -> None:
    assert MOST_CYCLES == 20
    period, n = 300.0, 86_400
    op = 50 + 3 * np.sin(2 * np.pi * np.arange(n) / period)
    pv = np.round(op / 4) * 4 + 0.1 * np.random.default_rng(0).normal(size=n)
    of_day = stiction_search(op, pv, period)
    last = slice(-int(MOST_CYCLES * period), None)
    assert stiction_search(op[last], pv[last], period).improvement == of_day.improvement
