"""What settings do on every process that may be the true one, as a band about the middle."""

from collections.abc import Sequence

import numpy as np

from advice.display import digits
from advice.fan import Fan, box_draws, fan_of, uncertain_processes
from advice.horizon import horizon
from advice.report.drawing import MARK, SECOND, STRONG, Axis, Figure, line, stacked
from advice.report.loop_figures import Candidate
from advice.tune import TuningCase
from identification.draws import parameter_draws
from loop.batch import ProcessBatch
from loop.experiment import Experiment
from loop.process import Process, TransferFunction
from loop.signals import Real

LOOKS = (STRONG, SECOND)
FILLS = ("rgba(176,84,30,0.18)", "rgba(138,148,160,0.18)")
DRAWS = 100
# Where no record tells how wrong the model is.
BOX = 0.25


def processes_of(case: TuningCase) -> tuple[ProcessBatch, str] | None:
    """Processes to fan over, and where they come from in words; none for a general process.

    Parameters
    ----------
    case : TuningCase
        A case with a process.
    """
    process = case.process
    if process is None or isinstance(process, TransferFunction):
        return None
    drawn = _drawn(case, process)
    if drawn is not None:
        return uncertain_processes(process, drawn), (
            f"{DRAWS} processes that the record cannot tell from the model"
        )
    return uncertain_processes(process, box_draws(process, BOX, n=DRAWS)), (
        f"{DRAWS} processes with all parameters off at once by up to ±{100 * BOX:.0f} %"
    )


def _drawn(case: TuningCase, process: Process) -> Real | None:
    """Draws from the record's own errors, where it has them for this very process."""
    if case.model is None or case.model.process != process:
        return None
    try:
        return parameter_draws(case.model, n=DRAWS)
    except ValueError:
        return None


def fan_figures(
    case: TuningCase,
    candidates: Sequence[Candidate],
    *,
    set_point: float,
    load: float,
    pv: str,
) -> dict[str, tuple[Figure, str]]:
    """Draw a set-point and a load step of each controller over all these processes.

    Parameters
    ----------
    case : TuningCase
        A case with a process.
    candidates : sequence of Candidate
        Controllers with a stable loop.
    set_point, load : float
        Sizes of the steps. [PV], [OP]
    pv : str
        Unit of PV.

    Returns
    -------
    dict
        Figure and caption by name; empty where there is nothing to fan over.
    """
    found = processes_of(case)
    if found is None or case.process is None:
        return {}
    processes, words = found
    t_end, dt = horizon(case.process, [candidate.pid for candidate in candidates])
    dt = max(dt, t_end / 600)
    figures = {}
    for name, title, experiment in (
        ("fan_setpoint", "Set-point step", Experiment(t_end=t_end, dt=dt, sp=set_point)),
        ("fan_load", "Load step", Experiment(t_end=t_end, dt=dt, load=load)),
    ):
        fans = {c.name: fan_of(processes, c.pid, experiment) for c in candidates}
        shown = {name: fan for name, fan in fans.items() if fan is not None}
        if shown:
            level = set_point if name == "fan_setpoint" else 0.0
            figures[name] = (_figure(shown, level, pv), _caption(title, words, shown))
    return figures


def _figure(fans: dict[str, Fan], level: float, pv: str) -> Figure:
    traces = []
    for (name, fan), look, fill in zip(fans.items(), LOOKS, FILLS, strict=False):
        edge = look._replace(width=0.6)
        low = line(fan.t, fan.low, f"{name}, 5 %", edge, legend=False)
        high = line(fan.t, fan.high, f"{name}, 5 to 95 %", edge)
        traces += [low, {**high, "fill": "tonexty", "fillcolor": fill}]
        traces.append(line(fan.t, fan.median, f"{name}, middle", look))
    ends = next(iter(fans.values())).t[[0, -1]]
    traces.append(line(ends, np.full(2, level), "set point", MARK, legend=False))
    return stacked(traces, Axis(title="Time [s]"), [Axis(title=f"PV [{pv}]")], height=320)


def _caption(title: str, words: str, fans: dict[str, Fan]) -> str:
    parts = [f"{title} on {words}: band of 5 to 95 % and middle."]
    for name, fan in fans.items():
        grows = f", {fan.diverged} of them grow without bound" if fan.diverged else ""
        least, most = digits(fan.peak[0], 3), digits(fan.peak[2], 3)
        parts.append(f"{name}: largest move of PV {least} to {most}{grows}.")
    return " ".join(parts)
