"""From when to when a wave is there: the longest run of windows with a fair part of its power."""

import numpy as np

from loop.signals import Real

PERSISTENT_SHARE = 0.6
ENOUGH_POWERS = 8192


def activity(square: Real, period: float, region: tuple[int, int]) -> tuple[int, int, float, float]:
    """First and one past the last sample of the longest active run, active part, amplitude.

    A window of one period is active where its mean square reaches a quarter of the region's 90 %
    quantile, or an eighth of what it is on average where the energy lies: a burst may be shorter
    than a tenth of the region. Breaks of up to two periods do not end a run. The active part
    counts all of the record: noise may break the run of a wave that never stops.
    """
    window = max(round(period), 2)
    sums = np.cumsum(np.r_[0.0, square])
    power = np.maximum(sums[window:] - sums[:-window], 0.0) / window
    there = power[region[0] : max(region[1] - window, region[0] + 1)]
    # A quantile is known from so many samples; sorting all of a day would only take time.
    there = there[:: max(there.size // ENOUGH_POWERS, 1)]
    place = 0.9 * (there.size - 1)
    below, above = int(place), min(int(place) + 1, there.size - 1)
    parted = np.partition(there, (below, above))
    high = float(parted[below] + (place - below) * (parted[above] - parted[below]))
    total = float(np.sum(there))
    burst = float(there @ there) / total if total > 0 else 0.0
    active = power >= 0.25 * max(high, 0.5 * burst)
    turns = np.flatnonzero(active[1:] != active[:-1]) + 1
    edges = np.r_[0, turns, active.size]
    starts, ends = (edges[k : edges.size - 1 + k][int(not active[0]) :: 2] for k in (0, 1))
    apart = starts[1:] - ends[:-1] + 1 > 2 * window
    starts, ends = starts[np.r_[True, apart]], ends[np.r_[apart, True]] - 1
    part = int(np.count_nonzero(active)) / power.size
    best = int(np.argmax(ends - starts))
    first, last = int(starts[best]), int(ends[best]) + window
    if part >= PERSISTENT_SHARE:
        first, last = int(starts[0]), int(ends[-1]) + window
    amplitude = float(np.sqrt(2 * np.mean(square[first:last])))
    return first, last, part, amplitude
