"""`loopwright assess`: routine data in, what is wrong with each loop out."""

import json
import math
from collections.abc import Iterator
from datetime import UTC, datetime, time, timedelta
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from advice.display import digits
from advice.fleet import (
    Crew,
    FleetLoop,
    LoopResult,
    assess_fleet,
    cluster_crew,
    local_crew,
    not_read,
)
from advice.rollup import Scored, plant_scorecard
from loop.digital_pid import OutputLimits
from loop.process import LARGEST, SMALLEST
from loop.record import Record
from monitoring.known_loop import KnownLoop
from monitoring.loop_signals import LoopKind
from service.actors import Role
from service.assessments.actions import request_assessments
from service.assessments.schemas import AssessLoops
from service.assessments.work import assess_period
from service.cli import reading
from service.cli.installation import DataFolder, acting, opened, settings_for, writing
from service.cli.listing import print_columns
from service.cli.many_loops import files_of, records_in
from service.cli.stating import (
    CONTROLLER_HELP,
    PROCESS_HELP,
    controller_from_text,
    process_from_text,
)
from service.jobs.store import job_with_id
from service.jobs.worker import Worker
from service.samples import open_samples
from service.settings import Settings

REFUSED = 3
HEADINGS = ("Loop", "Grade", "Cause", "Confidence", "Action", "Because")
WORTH_PROCESSES = 16  # files; starting processes takes as long as a few of them


def assess(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE|FOLDER]",
            help="Export (CSV), Parquet file, or folder of Parquet files; without one, the loops "
            "of the installation.",
        ),
    ] = None,
    day: Annotated[
        datetime | None,
        typer.Option(formats=["%Y-%m-%d"], metavar="DATE", help="Day in UTC, such as 2026-01-31."),
    ] = None,
    kind: Annotated[
        LoopKind, typer.Option(help="What the loops of a file control: decides the limits.")
    ] = LoopKind.OTHER,
    pv_low: Annotated[float | None, typer.Option(help="Low end of the PV range.")] = None,
    pv_high: Annotated[float | None, typer.Option(help="High end of the PV range.")] = None,
    limit_low: Annotated[
        float | None, typer.Option(help="Lowest PV that the process allows.")
    ] = None,
    limit_high: Annotated[
        float | None, typer.Option(help="Highest PV that the process allows.")
    ] = None,
    op_low: Annotated[float, typer.Option(help="Low end of the OP range.")] = 0.0,
    op_high: Annotated[float, typer.Option(help="High end of the OP range.")] = 100.0,
    model: Annotated[
        str | None,
        typer.Option(metavar="PROCESS", help=f"Process of the loop of a file: {PROCESS_HELP}"),
    ] = None,
    settings_: Annotated[
        str | None,
        typer.Option(
            "--settings",
            metavar="SETTINGS",
            help=f"Settings that ran, with --model: {CONTROLLER_HELP}",
        ),
    ] = None,
    tau_c: Annotated[
        float | None,
        typer.Option(metavar="S", help="Desired closed-loop time constant to be judged by."),
    ] = None,
    scan_time: Annotated[
        float | None,
        typer.Option(metavar="S", help="Scan time of the controller, with --model."),
    ] = None,
    processes: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes beside each other.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the documents that the API answers.")
    ] = False,
    time_column: Annotated[
        str | None, typer.Option("--time", metavar="COL", help="Column with the time.")
    ] = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    sp: reading.SPColumn = None,
    mode: reading.ModeColumn = None,
    tag: reading.Tag = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
    data: DataFolder = None,
) -> int:
    """Assess routine data: what is wrong with each loop, how sure that is, and what to do next.

    Exit code 0: answered. 3: no loop could be assessed, with the reasons. 2: called wrongly.
    1: failed. Ctrl-C stops it; what an installation had stored by then stays.
    """
    settings = settings_for(data=data)
    crew = _crew(settings, processes, scheduler)
    known = _known(model, settings_, OutputLimits(low=op_low, high=op_high), scan_time)
    if tau_c is not None and not SMALLEST <= tau_c <= LARGEST:
        raise typer.BadParameter(f"--tau-c must lie within {SMALLEST:g} and {LARGEST:g}")
    if source is None:
        if known is not None or tau_c is not None:
            raise typer.BadParameter(
                "--model, --settings and --tau-c belong to a file; the installation's loops have "
                "their sheets"
            )
        if day is None:
            raise typer.BadParameter("state --day, or a file or folder to assess")
        return _installation(settings, day, crew, as_json=as_json)
    stated = reading.Stated(
        time=time_column, pv=pv, op=op, sp=sp, mode=mode, tag=tag, time_format=time_format,
        time_zone=time_zone, day_first=day_first, layout=layout, mode_code=mode_code,
    )  # fmt: skip
    pv_range = _range(pv_low, pv_high)
    limits = _limits(limit_low, limit_high)
    files = files_of(source)
    found: list[LoopResult] = []

    def refused(tag: str, reason: str) -> None:
        found.append(not_read(tag, reason, kind=kind))

    loops = (
        FleetLoop(
            name=record.tag, record=record, kind=kind, pv_range=pv_range,
            op_range=(op_low, op_high), known=known, tau_c=tau_c, pv_limits=limits,
        )
        for record in _single(
            records_in(files, stated, refused=refused if source.is_dir() else None), known
        )
    )  # fmt: skip
    few = len(files) < WORTH_PROCESSES and scheduler is None
    with _bar() as bar:
        shown = bar.add_task("Assessing", total=len(files) if source.is_dir() else None)
        for one in assess_fleet(loops, crew=None if few else crew):
            found.append(one)
            bar.advance(shown)
    return _answer(found, as_json=as_json)


def _crew(settings: Settings, processes: int | None, scheduler: str | None) -> Crew:
    if scheduler is not None:
        try:
            return cluster_crew(scheduler)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error
    return local_crew(processes or settings.job_processes)


def _known(
    model: str | None, settings: str | None, limits: OutputLimits, scan_time: float | None
) -> KnownLoop | None:
    if model is None:
        if settings is not None or scan_time is not None:
            raise typer.BadParameter("--settings and --scan-time need the --model they belong to")
        return None
    if scan_time is not None and not SMALLEST <= scan_time <= LARGEST:
        raise typer.BadParameter(f"--scan-time must lie within {SMALLEST:g} and {LARGEST:g}")
    process = process_from_text(model)
    controller = None if settings is None else controller_from_text(settings, process)
    return KnownLoop(process=process, controller=controller, limits=limits, scan_time=scan_time)


def _single(records: Iterator[Record], known: KnownLoop | None) -> Iterator[Record]:
    """Refuse one model for several loops."""
    for k, record in enumerate(records):
        if k and known is not None:
            raise typer.BadParameter("--model belongs to one loop; name it with --tag")
        yield record


def _limits(low: float | None, high: float | None) -> tuple[float, float] | None:
    if low is None and high is None:
        return None
    limits = (-math.inf if low is None else low, math.inf if high is None else high)
    if not limits[0] < limits[1]:
        raise typer.BadParameter(f"--limit-high must be above --limit-low, got {low} to {high}")
    return limits


def _range(low: float | None, high: float | None) -> tuple[float, float] | None:
    if (low is None) != (high is None):
        raise typer.BadParameter("state both --pv-low and --pv-high, or neither")
    return None if low is None or high is None else (low, high)


def _installation(settings: Settings, day: datetime, crew: Crew, *, as_json: bool) -> int:
    """Do the job of one day here and now, watched; the installation keeps it like any other."""
    start = datetime.combine(day.date(), time(), UTC)
    wanted = AssessLoops(start=start, end=start + timedelta(days=1))
    found: list[LoopResult] = []
    with opened(settings) as held:
        actor = acting(held, Role.ENGINEER)
        with writing(held) as session:
            job_id = request_assessments(session, actor=actor, wanted=wanted).id
        with _bar() as bar:
            shown = bar.add_task("Assessing", total=None)
            samples = open_samples(settings)

            def tell(stored: list[LoopResult], done: int, total: int) -> None:
                found.extend(stored)
                bar.update(shown, completed=done, total=total)

            work = {"assess": lambda task: assess_period(samples, crew, task, tell)}
            Worker(held, work).work_once(job_id)
        with held.readings() as session:
            job = job_with_id(session, job_id)
        if job.state != "done":
            raise ValueError(job.message)
    return _answer(found, as_json=as_json)


def _answer(found: list[LoopResult], *, as_json: bool) -> int:
    if as_json:
        bodies = [one.body for one in found]
        typer.echo(json.dumps({"assessments": bodies}, indent=1, allow_nan=False))
    else:
        _print(found)
    return 0 if any(one.points is not None for one in found) else REFUSED


def _print(found: list[LoopResult]) -> None:
    rows = [
        (
            one.tag,
            "-" if one.points is None else f"{one.points:.0f} {one.word}",
            " or ".join((one.cause, *one.others)),
            one.confidence,
            one.action,
            one.because,
        )
        for one in sorted(found, key=lambda one: 101.0 if one.points is None else one.points)
    ]
    print_columns(HEADINGS, rows)
    card = plant_scorecard(
        Scored(
            name=one.name, tag=one.tag, area="", unit="", weight=1.0, points=one.points,
            cause=one.cause,
        )
        for one in found
    )  # fmt: skip
    plant = card.plant
    grade = "-" if plant.points is None else digits(plant.points)
    causes = ", ".join(f"{count} {cause}" for cause, count in plant.causes)
    typer.echo(f"\nLoops: {plant.loops}, assessable: {plant.assessable}, mean grade {grade}")
    typer.echo(f"Causes: {causes or 'none'}")


def _bar() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
