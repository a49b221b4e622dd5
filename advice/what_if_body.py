"""Simulated runs as the JSON document that the command line prints and the API answers.

Numbers keep full precision. null stands for infinity and for a number that does not exist.
"""

from dataclasses import asdict

import numpy as np

from advice.body import Body, number, numbers, process_body, settings_body
from advice.fan import BAND, Fan
from advice.scenario import Conditions, Event, Replay
from advice.what_if import Answer, Run, WhatIf
from loop.signals import Real

# A picture needs no more; measures come from every scan.
MOST_POINTS = 600
KINDS = {
    "SetPointChange": "set point",
    "LoadChange": "load",
    "Transfer": "transfer",
    "Replay": "replay",
}


def what_if_body(found: WhatIf) -> Body:
    """Everything that was simulated.

    Parameters
    ----------
    found : WhatIf
        What `advice.what_if` answered.
    """
    return {
        "process": process_body(found.process),
        "conditions": conditions_body(found.conditions),
        "scan_time": found.scan_time,
        "t_end": found.t_end,
        "draws": found.draws,
        "events": [_answer_body(answer) for answer in found.answers],
        "noise_movement": {name: asdict(item) for name, item in found.movements.items()},
    }


def conditions_body(given: Conditions) -> Body:
    """What was between the settings and the process."""
    valve = given.valve
    return {
        "low": number(given.limits.low),
        "high": number(given.limits.high),
        "rate": number(given.limits.rate),
        "anti_windup": given.anti_windup.value,
        "Tt": given.Tt,
        "pv_filter": given.pv_filter,
        "noise": given.noise,
        "resolution": given.resolution,
        "valve": None if valve is None else {"model": type(valve).__name__, **asdict(valve)},
        "pv0": given.pv0,
        "op0": given.op0,
        "seed": given.seed,
    }


def event_body(event: Event) -> Body:
    """What happened."""
    kind: Body = {"kind": KINDS[type(event).__name__]}
    if isinstance(event, Replay):
        return {**kind, "tag": event.record.tag}
    return {**kind, **{name: number(value) for name, value in asdict(event).items()}}


def _answer_body(answer: Answer) -> Body:
    body: Body = {
        "event": event_body(answer.event),
        "runs": [_run_body(run) for run in answer.runs],
    }
    replayed = answer.replayed
    if replayed is not None:
        kept = _thinned(replayed.pv)
        body["recorded"] = {
            "t": numbers(kept * replayed.dt),
            "pv": numbers(replayed.pv[kept]),
            "op": numbers(replayed.op[kept]),
            "disturbance": numbers(replayed.disturbance[kept]),
            "bridged": replayed.bridged,
            "measures": None
            if answer.recorded_measures is None
            else _plain(asdict(answer.recorded_measures)),
        }
    return body


def _run_body(run: Run) -> Body:
    body: Body = {
        "name": run.name,
        "settings": settings_body(run.pid),
        "measures": None if run.measures is None else _plain(asdict(run.measures)),
        "effort": None if run.effort is None else _plain(asdict(run.effort)),
        "bump": run.bump,
        "fan": None if run.fan is None else _fan_body(run.fan),
        "trouble": run.trouble,
        "response": None,
    }
    if run.response is not None:
        kept = _thinned(run.response.t)
        names = ("t", "sp", "pv", "op", "true_pv", "position")
        body["response"] = {name: numbers(getattr(run.response, name)[kept]) for name in names}
    return body


def _fan_body(fan: Fan) -> Body:
    kept = _thinned(fan.t)
    curves = ("t", "low", "median", "high", "least", "most")
    return {
        "quantiles": list(BAND),
        **{name: numbers(getattr(fan, name)[kept]) for name in curves},
        "diverged": fan.diverged,
        "peak": list(fan.peak),
        "IAE": list(fan.IAE),
        "travel": list(fan.travel),
    }


def _plain(values: dict[str, float | int | None]) -> Body:
    return {name: number(value) for name, value in values.items()}


def _thinned(signal: Real) -> Real:
    """Every k-th scan, the first and the last included."""
    every = -(-(signal.size - 1) // MOST_POINTS) or 1
    return np.unique(np.append(np.arange(0, signal.size, every), signal.size - 1))
