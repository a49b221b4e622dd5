"""`loopwright propose`: a stated process in, verified settings out."""

import json
from typing import Annotated

import typer

from advice.case_body import case_body
from advice.robust_body import robust_body
from advice.tune import tune_process
from loop.errors import RuleNotApplicable
from service.cli import asking
from service.cli.answering import REFUSED, AsJson
from service.cli.printing import print_stated_case
from service.cli.stating import (
    CONTROLLER_HELP,
    PROCESS_HELP,
    controller_from_text,
    process_from_text,
)
from tuning.profiles import DEFAULT_PROFILE, PROFILES


def propose(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
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
        typer.Option(metavar="SETTINGS", help=f"Settings to compare with: {CONTROLLER_HELP}"),
    ] = None,
    proof: asking.Proof = False,
    optimal: asking.Optimal = False,
    load: asking.Load = None,
    allowed: asking.Allowed = None,
    as_json: AsJson = False,
    report: asking.Report = None,
) -> int:
    """Tune a process that is known already, by every rule, and verify the settings.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly.
    1: failed.
    """
    plant = process_from_text(process)
    now = None if running is None else controller_from_text(running, plant)
    if profile not in PROFILES:
        raise typer.BadParameter(f"--profile must be one of {', '.join(PROFILES)}, got {profile}")
    try:
        case = tune_process(plant, profile=profile, tau_c=tau_c, scan_time=scan_time, running=now)
    except RuleNotApplicable as reason:
        typer.echo(str(reason), err=True)
        return REFUSED
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    asked = asking.worked_out(
        case, proof=proof, optimal=optimal, scan_time=scan_time, load=load, allowed=allowed
    )
    if as_json:
        body = case_body(case) | robust_body(asked.proof, asked.choices)
        typer.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        print_stated_case(case, title=process)
        asking.print_asked(asked)
    if report is not None:
        asking.write_file(case, report, title=process, asked=asked)
    return 0
