"""`loopwright analyse`: a process and a controller in, everything the toolbox says of them out."""

import json
from typing import Annotated

import typer
from rich.console import Console

from advice.analyse import Analysis, Task
from advice.analyse import analyse as analyse_loop
from advice.analysis_body import analysis_body
from advice.analysis_words import limit_words, loop_words, pole_words, task_words
from service.cli.stating import (
    COMPENSATOR_HELP,
    CONTROLLER_HELP,
    PROCESS_HELP,
    compensator_from_text,
    controller_from_text,
    process_from_text,
)
from tuning.profiles import DEFAULT_PROFILE, PROFILES


def analyse(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    controller: Annotated[str, typer.Argument(metavar="CONTROLLER", help=CONTROLLER_HELP)],
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    scan_time: Annotated[
        float, typer.Option(metavar="S", help="Scan time of the controller in seconds.")
    ] = 0.0,
    load: Annotated[
        float | None, typer.Option(metavar="OP", help="Largest load step at the process input.")
    ] = None,
    allowed: Annotated[
        float | None, typer.Option(metavar="PV", help="Deviation of PV that may happen.")
    ] = None,
    frequency: Annotated[
        float | None, typer.Option(metavar="RAD/S", help="Highest frequency of the load.")
    ] = None,
    ramp: Annotated[
        float | None, typer.Option(metavar="OP/S", help="Fastest lasting change of the load.")
    ] = None,
    crossover: Annotated[
        float | None, typer.Option(metavar="RAD/S", help="Gain crossover wanted.")
    ] = None,
    unmodelled: Annotated[
        float, typer.Option(metavar="S", help="Lags and dead times that the model leaves out.")
    ] = 0.0,
    op_room: Annotated[
        float | None, typer.Option(metavar="OP", help="How far the output can move.")
    ] = None,
    set_point_change: Annotated[
        float | None, typer.Option(metavar="PV", help="Largest change of the set point.")
    ] = None,
    relative_gain: Annotated[
        float | None, typer.Option(metavar="X", help="Relative gain of the pairing.")
    ] = None,
    series: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND:NUMBERS",
            help=f"Compensator in series, repeatable: {COMPENSATOR_HELP}",
        ),
    ] = None,
    points: Annotated[
        int, typer.Option(min=2, max=2000, help="Frequencies of the curves, beside crossovers.")
    ] = 300,
    pade_order: Annotated[
        int | None,
        typer.Option(min=1, max=12, help="Takes a dead time into Routh's array."),
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures/--no-figures", help="Plotly documents in the JSON.")
    ] = True,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
) -> int:
    """Analyse a process with a controller: margins, poles, limits of performance, with dead time.

    Exit code 0: answered. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    pid = controller_from_text(controller, plant)
    if profile not in PROFILES:
        raise typer.BadParameter(f"--profile must be one of {', '.join(PROFILES)}, got {profile}")
    try:
        analysis = analyse_loop(
            plant, pid, compensators=[compensator_from_text(text) for text in series or ()],
            scan_time=scan_time, profile=profile, points=points, pade_order=pade_order,
            task=Task(
                load=load, allowed=allowed, frequency=frequency, wc=crossover, ramp=ramp,
                unmodelled=unmodelled, op_room=op_room, set_point_change=set_point_change,
                relative_gain=relative_gain,
            ),
        )  # fmt: skip
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    if as_json:
        typer.echo(json.dumps(analysis_body(analysis, figures=figures), indent=1, allow_nan=False))
    else:
        _print(analysis)
    return 0


def _print(analysis: Analysis) -> None:
    out = Console(soft_wrap=True, highlight=False)
    for title, sentences in (
        ("Loop", loop_words(analysis)),
        ("Closed-loop poles", pole_words(analysis)),
        ("Limits of performance", limit_words(analysis)),
        ("Task", task_words(analysis)),
        ("Notes", list(analysis.notes)),
    ):
        if sentences:
            out.print(f"[bold]{title}[/bold]")
            for sentence in sentences:
                out.print(f"  {sentence}", markup=False)
