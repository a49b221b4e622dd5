"""Figure of the page on stiction: is the probability true, and how small a fault is found."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from benchmarks.stiction_windows import all_outcomes, by_size, reliability
from benchmarks.virtual_windows import NEVER
from docs.figures.style import Draw, label, model, panels, truth


def stiction() -> Figure:
    """Stated against true probability, and the part of sticking windows found by size."""
    found = all_outcomes()
    figure, (left, right) = panels(2, columns=2)
    stated, true, _ = (np.array(column) for column in zip(*reliability(found), strict=True))
    truth(left, np.array([0.0, 1.0]), np.array([0.0, 1.0]), "stated = true")
    model(left, stated, true, "simulated windows")
    label(left, x="Stated probability [-]", y="True share that sticks [-]",
          title="Is the probability true?", legend="upper left")  # fmt: skip
    rows = [row for row in by_size(found) if row[0] != NEVER]
    middle = np.array([np.sqrt(low * high) for low, high, _, _ in rows])
    model(right, middle, np.array([100 * part for _, _, part, _ in rows]), "called sticking")
    right.set_xscale("log")
    right.set_ylim(0.0, 100.0)
    right.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
    label(right, x="S [% of OP]", y="Windows found [%]", title="How small a fault is found?")
    return figure


FIGURES: Mapping[str, Draw] = {"stiction": stiction}
