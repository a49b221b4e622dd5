"""Draw what a sticking valve does to the Tennessee Eastman plant, for the plant-wide page.

    python -m benchmarks.eastman_figure

needs the package `tep-studio` (dependency group `plants`).
"""

from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.eastman_plant import REACTOR_TEMPERATURE, SEPARATOR_TEMPERATURE, eastman_run
from docs.figures.style import data, held, label, model, panels, truth, write

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "images"
FROM, TO = 1000, 1250
VICTIMS = ("Reactor pressure", SEPARATOR_TEMPERATURE)


def sticking_valve() -> Figure:
    """Half an hour with a sticking cooling valve: output, true stem, and who follows."""
    run = eastman_run(14, hours=4.0)
    loops = {record.tag: record for record in run.records}
    shown = slice(FROM, TO)
    reactor = loops[REACTOR_TEMPERATURE]
    minutes = (reactor.t[shown] - reactor.t[FROM]) / 60
    figure, (top, middle, *rest) = panels(2 + len(VICTIMS))
    model(top, minutes, reactor.op[shown], "output")
    held(top, minutes, run.stems[REACTOR_TEMPERATURE][shown], "true stem")
    label(top, y="OP [%]", title="Reactor cooling valve, IDV 14", legend="upper right")
    truth(middle, minutes, reactor.pv[shown])
    label(middle, y="PV [°C]", title="Reactor temperature, where it begins")
    for axes, tag, unit in zip(rest, VICTIMS, ("kPa", "°C"), strict=True):
        data(axes, minutes, loops[tag].pv[shown])
        label(axes, y=f"PV [{unit}]", title=f"{tag}, dragged along")
    label(rest[-1], x="Time [min]", y="PV [°C]", title=f"{VICTIMS[-1]}, dragged along")
    return figure


if __name__ == "__main__":
    write({"tennessee-eastman": sticking_valve}, FOLDER)
