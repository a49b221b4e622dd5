"""`loopwright simulate`: settings in, what they will do out, before anybody types them."""

import json
import math
from dataclasses import astuple
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from advice.display import digits
from advice.fan import box_draws
from advice.scenario import Conditions, Event, LoadChange, Replay, SetPointChange, Transfer
from advice.what_if import Answer, Effort, ErrorMeasures, Run, WhatIf, what_if
from advice.what_if_body import KINDS, what_if_body
from loop.digital_pid import AntiWindup, OutputLimits
from loop.measures import LoadMeasures, StepMeasures
from loop.process import Process
from loop.signals import Real
from loop.valve import Choudhury, DeadBand, He, Kano, Valve
from service.cli import reading
from service.cli.stating import (
    CONTROLLER_HELP,
    PROCESS_HELP,
    controller_from_text,
    process_from_text,
)

VALVE_HELP = "Choudhury:S,J, Kano:S,J, He:FS,FD or DeadBand:WIDTH, in % of the output."


def simulate(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    controller: Annotated[str, typer.Argument(metavar="CONTROLLER", help=CONTROLLER_HELP)],
    against: Annotated[
        str | None, typer.Option(metavar="CONTROLLER", help="Settings to compare, such as now's.")
    ] = None,
    step: Annotated[
        float | None, typer.Option(metavar="PV", help="Move of the set point; 1 if no event.")
    ] = None,
    ramp: Annotated[
        float | None, typer.Option(metavar="PV/S", help="Speed of that move; a step if not given.")
    ] = None,
    load: Annotated[
        float | None, typer.Option(metavar="OP", help="Load step at the process input.")
    ] = None,
    transfer: Annotated[
        float | None,
        typer.Option(metavar="PV", help="Transfer to automatic, set point so far from PV."),
    ] = None,
    replay: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Export whose recorded disturbance is met again."),
    ] = None,
    scan_time: Annotated[float | None, typer.Option(metavar="S", help="Scan time.")] = None,
    length: Annotated[float | None, typer.Option(metavar="S", help="Length of a run.")] = None,
    limits: Annotated[
        str | None, typer.Option(metavar="LOW,HIGH", help="Limits of the output.")
    ] = None,
    rate: Annotated[
        float, typer.Option(metavar="OP/S", help="Fastest move of the output.")
    ] = math.inf,
    anti_windup: Annotated[
        AntiWindup, typer.Option(help="What the integral does at a limit.")
    ] = AntiWindup.BACK_CALCULATION,
    tracking_time: Annotated[
        float | None, typer.Option(metavar="S", help="Tt of back-calculation; its rule if none.")
    ] = None,
    pv_filter: Annotated[float, typer.Option(metavar="S", help="Filter on PV.")] = 0.0,
    noise: Annotated[
        float, typer.Option(metavar="PV", help="Standard deviation of the sensor's noise.")
    ] = 0.0,
    resolution: Annotated[
        float, typer.Option(metavar="PV", help="Smallest change that the sensor shows.")
    ] = 0.0,
    valve: Annotated[str | None, typer.Option(metavar="MODEL:NUMBERS", help=VALVE_HELP)] = None,
    rest: Annotated[
        str, typer.Option(metavar="PV,OP", help="Where the loop rests before the event.")
    ] = "0,0",
    spread: Annotated[
        float | None,
        typer.Option(metavar="%", help="Fan: all parameters of the process off by up to this."),
    ] = None,
    count: Annotated[
        int, typer.Option(min=1, max=500, help="Processes of that fan; its corners come first.")
    ] = 100,
    draws: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Fan over these processes instead: one a line, its parameters by commas.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 1,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    sp: reading.SPColumn = None,
    tag: reading.Tag = None,
) -> int:
    """Simulate settings before they are typed: steps, loads, a record met again.

    Exit code 0: answered. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    controllers = {"new": controller_from_text(controller, plant)}
    if against is not None:
        controllers["against"] = controller_from_text(against, plant)
    stated = reading.Stated(time=time, pv=pv, op=op, sp=sp, tag=tag)
    try:
        events = _events(step, ramp, load, transfer)
        if replay is not None:
            events.append(Replay(record=reading.read_record(replay, stated)[0]))
        low, high = (-math.inf, math.inf) if limits is None else _pair("--limits", limits)
        pv0, op0 = _pair("--rest", rest)
        found = what_if(
            plant,
            controllers,
            events or [SetPointChange(size=1.0, rate=ramp)],
            conditions=Conditions(
                scan_time=scan_time,
                t_end=length,
                limits=OutputLimits(low=low, high=high, rate=rate),
                anti_windup=anti_windup,
                Tt=tracking_time,
                pv_filter=pv_filter,
                noise=noise,
                resolution=resolution,
                valve=None if valve is None else _valve(valve),
                pv0=pv0,
                op0=op0,
                seed=seed,
            ),
            draws=_draws(plant, spread, count, draws),
        )
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    if as_json:
        typer.echo(json.dumps(what_if_body(found), indent=1, allow_nan=False))
    else:
        _print(found)
    return 0


def _events(
    step: float | None, ramp: float | None, load: float | None, transfer: float | None
) -> list[Event]:
    events: list[Event] = []
    if step is not None:
        events.append(SetPointChange(size=step, rate=ramp))
    if load is not None:
        events.append(LoadChange(size=load))
    if transfer is not None:
        events.append(Transfer(size=transfer))
    return events


def _draws(plant: Process, spread: float | None, count: int, file: Path | None) -> Real | None:
    if file is not None:
        if spread is not None:
            raise typer.BadParameter("give either --spread or --draws")
        if not file.is_file():
            raise typer.BadParameter(f"there is no file {file}")
        rows = [line.split(",") for line in file.read_text("utf-8").splitlines() if line.strip()]
        if len({len(row) for row in rows}) != 1:
            raise typer.BadParameter("every line of --draws must hold as many numbers")
        return np.array([[float(part) for part in row] for row in rows])
    return None if spread is None else box_draws(plant, spread / 100, n=count)


def _pair(option: str, text: str) -> tuple[float, float]:
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError as error:
        raise typer.BadParameter(f"{option} takes two numbers such as 0,100, got {text!r}") from (
            error
        )
    return first, second


def _valve(text: str) -> Valve:
    name, _, rest = text.partition(":")
    try:
        numbers = [float(part) for part in rest.split(",")]
        match name.lower(), numbers:
            case "choudhury", [S, J]:
                return Choudhury(S=S, J=J)
            case "kano", [S, J]:
                return Kano(S=S, J=J)
            case "he", [fs, fd]:
                return He(fs=fs, fd=fd)
            case "deadband", [width]:
                return DeadBand(width=width)
    except ValueError as error:
        raise typer.BadParameter(f"{error}. A valve is {VALVE_HELP}") from error
    raise typer.BadParameter(f"there is no valve {text!r}. A valve is {VALVE_HELP}")


def _print(found: WhatIf) -> None:
    out = Console(soft_wrap=True, highlight=False)
    out.width = max(out.width, 120)
    kind = type(found.process).__name__
    numbers = ", ".join(
        digits(v) if isinstance(v, float) else str(v) for v in astuple(found.process)
    )
    out.print(f"[bold]{kind} {numbers}[/bold]; scan {digits(found.scan_time)} s", markup=True)
    for answer in found.answers:
        out.print()
        out.print(_table(answer))
        for run in answer.runs:
            for sentence in _remarks(run, found.draws):
                out.print(f"  {run.name}: {sentence}", markup=False)
    for name, moved in found.movements.items():
        out.print(
            f"\n{name}: the noise alone moves the output by {digits(moved.travel)} OP a day, with "
            f"{digits(moved.reversals)} reversals; sd {digits(moved.sd, 3)} OP.",
            markup=False,
        )


def _table(answer: Answer) -> Table:
    name = KINDS[type(answer.event).__name__]
    table = Table(title=name[0].upper() + name[1:], title_justify="left")
    rows = [
        (run.name, [*_measures(run.measures), *_effort(run.effort)])
        for run in answer.runs
        if run.measures is not None and run.effort is not None
    ]
    if answer.recorded_measures is not None:
        rows.append(("as recorded", _measures(answer.recorded_measures)))
    table.add_column("")
    for title, _ in rows[0][1] if rows else []:
        table.add_column(title, justify="right")
    for row, values in rows:
        table.add_row(row, *(text for _, text in values))
    return table


def _measures(found: StepMeasures | LoadMeasures | ErrorMeasures) -> list[tuple[str, str]]:
    match found:
        case StepMeasures():
            return [
                ("rise s", digits(found.rise_time, 3)),
                ("overshoot %", digits(found.overshoot, 3)),
                ("settling s", digits(found.settling_time, 3)),
                ("IAE PV s", digits(found.IAE)),
            ]
        case LoadMeasures():
            return [
                ("peak PV", digits(found.peak_deviation, 3)),
                ("at s", digits(found.peak_time, 3)),
                ("settling s", digits(found.settling_time, 3)),
                ("IAE PV s", digits(found.IAE)),
            ]
        case _:
            return [
                ("sd of error PV", digits(found.sd, 3)),
                ("largest error PV", digits(found.largest, 3)),
                ("IAE PV s", digits(found.IAE)),
            ]


def _effort(found: Effort) -> list[tuple[str, str]]:
    return [
        ("travel OP", digits(found.travel)),
        ("largest move OP", digits(found.largest_move, 3)),
        ("reversals", str(found.reversals)),
        ("at limit %", digits(100 * found.at_limit, 3)),
    ]


def _remarks(run: Run, draws: int) -> list[str]:
    sentences = [run.trouble] if run.trouble else []
    if run.bump is not None:
        sentences.append(f"bump at the transfer {run.bump:.1e} OP.")
    if run.fan is not None:
        low, _, high = run.fan.peak
        sentences.append(
            f"over {draws} processes PV moves by {digits(low, 3)} to {digits(high, 3)} at most "
            f"(5 to 95 %); {run.fan.diverged} of them grow without bound."
        )
    return sentences
