"""Draw the refinery loops that the stiction probability ranks wrongly, or tells apart the least.

`python -m docs.figures.refinery_hardest` writes `docs/images/stiction-hardest.png` where the data
are at hand.
"""

import numpy as np
from matplotlib.figure import Figure

from benchmarks.false_alarms import EPISODES, episode_probabilities, episode_signals, first_episode
from docs.figures.style import FOLDER, held, label, model, panels

# Of a curve: enough for its shape, few enough for a small file.
POINTS = 125


def hardest() -> list[str]:
    """Loops of lost pairs; where none is lost, the lowest sticky and the highest healthy one."""
    loops = episode_probabilities()
    sticky = {loop: row[1] for loop, row in loops.items() if row[0]}
    healthy = {loop: row[1] for loop, row in loops.items() if not row[0]}
    ceiling = max(*healthy.values(), min(sticky.values()))
    floor = min(*sticky.values(), max(healthy.values()))
    low = [loop for loop, p in sticky.items() if p <= ceiling]
    high = [loop for loop, p in healthy.items() if p >= floor]
    return sorted(low, key=sticky.__getitem__) + sorted(high, key=lambda loop: -healthy[loop])


def refinery_hardest(loops: list[str]) -> Figure:
    """PV (light) with its set point (dark), and OP, of the first episode of every loop."""
    said = episode_probabilities()
    figure, flat = panels(2 * len(loops), columns=2, share_x=False)
    for k, loop in enumerate(loops):
        file, dt = first_episode(loop)
        op, pv, sp = episode_signals(file).T
        t = dt * np.arange(op.size) / 60
        few = slice(None, None, max(op.size // POINTS, 1))
        left, right = flat[2 * k], flat[2 * k + 1]
        model(left, t[few], pv[few])
        held(left, t[few], sp[few])
        expert = "sticks" if said[loop][0] else "sound"
        label(left, y="PV", title=f"{loop}: {expert}, stated {said[loop][1]:.2f}")
        model(right, t[few], op[few])
        label(right, y="OP [%]")
    for axes in flat[-2:]:
        axes.set_xlabel("Time [min]")
    return figure


if __name__ == "__main__":
    if not EPISODES.is_dir():
        raise SystemExit(f"the refinery episodes are not at hand: {EPISODES}")
    # As points: with many loops the axes alone would fill the largest file of curves.
    refinery_hardest(hardest()).savefig(FOLDER.parent / "stiction-hardest.png", dpi=75)
