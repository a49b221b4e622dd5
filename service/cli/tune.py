"""`loopwright tune`: a file in, verified settings out."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from advice.case_body import case_body
from advice.report.page import write_report
from advice.robust_body import optimal_words, proof_words, robust_body
from advice.robust_choice import optimal_choices, prove_case
from advice.tune import TuningCase
from advice.tune import tune as tune_record
from loop.controller import PID
from service.cli import reading
from service.cli.printing import print_case
from tuning.profiles import DEFAULT_PROFILE, PROFILES

REFUSED = 3


def tune(
    file: reading.ExportFile,
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    op_before: reading.OpBefore = None,
    sp: reading.SPColumn = None,
    mode: reading.ModeColumn = None,
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    tau_c: Annotated[
        float | None,
        typer.Option(metavar="S", help="Desired closed-loop time constant in seconds."),
    ] = None,
    scan_time: Annotated[
        float, typer.Option(metavar="S", help="Scan time of the controller in seconds.")
    ] = 0.0,
    running: Annotated[
        str | None,
        typer.Option(
            metavar="KC,TI,TD",
            help="Settings in the controller now (ISA, seconds; TI may be inf), to compare with.",
        ),
    ] = None,
    relay_hysteresis: Annotated[
        float, typer.Option(metavar="PV", help="Half-width of a relay test's hysteresis.")
    ] = 0.0,
    proof: Annotated[
        bool,
        typer.Option(
            "--proof",
            help="Prove the worst margins with all parameters off by up to 50 % at once.",
        ),
    ] = False,
    optimal: Annotated[
        bool,
        typer.Option(
            "--optimal",
            help="Add the PI and PID of least load area that keep the profile over ±50 %, "
            "over what the record leaves open, and from calm to fast.",
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write one self-contained HTML page, or one A4 page as .pdf."
        ),
    ] = None,
    tag: reading.Tag = None,
    delimiter: reading.Delimiter = None,
    decimal: reading.Decimal = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
) -> int:
    """Identify the process behind a step test, tune it by every rule and verify the settings.

    Exit code 0: answered. 3: refused, with the reasons. 2: called wrongly. 1: failed.
    """
    stated = reading.Stated(
        time=time, pv=pv, op=op, sp=sp, mode=mode, op_before=op_before, tag=tag,
        delimiter=delimiter, decimal=decimal, time_format=time_format, time_zone=time_zone,
        day_first=day_first, layout=layout, mode_code=mode_code,
    )  # fmt: skip
    if profile not in PROFILES:
        raise typer.BadParameter(f"--profile must be one of {', '.join(PROFILES)}, got {profile}")
    now = None if running is None else _running(running)
    record, export = reading.read_record(file, stated)
    try:
        case = tune_record(
            record, profile=profile, tau_c=tau_c, scan_time=scan_time, running=now,
            relay_hysteresis=relay_hysteresis,
        )  # fmt: skip
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    proven = prove_case(case, scan_time=scan_time) if proof else None
    choices = optimal_choices(case, scan_time=scan_time) if optimal else None
    more = (
        ("Proof", [] if proven is None else proof_words(proven)),
        ("Optimal settings", [] if choices is None else optimal_words(choices)),
    )
    if as_json:
        body = case_body(case) | robust_body(proven, choices)
        typer.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        print_case(case, export, title=record.tag or file.name)
        for heading, sentences in more:
            _print_more(heading, sentences)
    if report is not None:
        title = record.tag or file.name
        if report.suffix.lower() == ".pdf":
            # What sets and draws it takes a second to load: only who asks for it waits.
            from advice.report.one_page import write_pdf

            write_pdf(case, report, title=title)
        else:
            write_report(case, report, title=title, more=more)
    return _code(case)


def _print_more(title: str, sentences: list[str]) -> None:
    if sentences:
        typer.echo("\n".join(("", title, *(f"  {sentence}" for sentence in sentences))))


def _code(case: TuningCase) -> int:
    return REFUSED if case.refused else 0


def _running(text: str) -> PID:
    try:
        Kc, Ti, Td = (float(part) for part in text.split(","))
        return PID(Kc=Kc, Ti=Ti if Ti > 0 else math.inf, Td=Td)
    except ValueError as error:
        raise typer.BadParameter(
            f"--running takes KC,TI,TD such as 0.8,120,0, got {text!r}"
        ) from error
