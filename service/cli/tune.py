"""`loopwright tune`: a file in, verified settings out."""

import json
import math
from typing import Annotated

import typer

from advice.case_body import case_body
from advice.robust_body import robust_body
from advice.tune import TuningCase
from advice.tune import tune as tune_record
from loop.controller import PID
from service.cli import asking, reading
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
    proof: asking.Proof = False,
    optimal: asking.Optimal = False,
    load: asking.Load = None,
    allowed: asking.Allowed = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
    report: asking.Report = None,
    tag: reading.Tag = None,
    delimiter: reading.Delimiter = None,
    decimal: reading.Decimal = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
) -> int:
    """Identify the process behind a test, tune it by every rule and verify the settings.

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
    asked = asking.worked_out(
        case, proof=proof, optimal=optimal, scan_time=scan_time, load=load, allowed=allowed
    )
    if as_json:
        body = case_body(case) | robust_body(asked.proof, asked.choices)
        typer.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        print_case(case, export, title=record.tag or file.name)
        asking.print_asked(asked)
    if report is not None:
        asking.write_file(case, report, title=record.tag or file.name, asked=asked)
    return _code(case)


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
