"""`loopwright plan`: what is known of a process in, a test to run out."""

import json
import math
from typing import Annotated

import typer

from advice.planning import plan_body, plan_sentences, plan_test, wishes_for
from loop.errors import NoLimitCycle
from loop.process import FOPDT, IPDT
from service.cli.stating import process_from_text

REFUSED = 3


def plan(
    process: Annotated[
        str,
        typer.Argument(
            metavar="PROCESS",
            help="FOPDT:K,TAU,THETA or IPDT:K,THETA as far as known, in seconds.",
        ),
    ],
    noise: Annotated[
        float, typer.Option(metavar="PV", help="Standard deviation of the noise of PV.")
    ],
    deviation: Annotated[float, typer.Option(metavar="PV", help="How far PV may move from rest.")],
    precision: Annotated[
        float, typer.Option(metavar="PART", help="Wanted half-width of the 95 % intervals.")
    ] = 0.1,
    factor: Annotated[
        float, typer.Option(metavar="X", help="K, tau, theta may be X times larger or smaller.")
    ] = 1.5,
    room_up: Annotated[float, typer.Option(metavar="OP", help="How far OP may go up.")] = math.inf,
    room_down: Annotated[
        float, typer.Option(metavar="OP", help="How far OP may go down.")
    ] = math.inf,
    sample_time: Annotated[
        float | None, typer.Option(metavar="S", help="Sample time, where it cannot be chosen.")
    ] = None,
    relay: Annotated[
        bool, typer.Option("--relay", help="Plan a relay test instead of moves in manual.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
) -> int:
    """Plan a test by steps, by pulses (of an integrator) or by relay: moves, errors, limits.

    Exit code 0: answered. 3: refused, with what would do. 2: called wrongly. 1: failed.
    """
    guess = process_from_text(process)
    if not isinstance(guess, FOPDT | IPDT):
        raise typer.BadParameter("tests are planned for FOPDT:K,TAU,THETA and IPDT:K,THETA")
    try:
        wishes = wishes_for(
            guess, noise=noise, deviation=deviation, precision=precision, factor=factor,
            room_up=room_up, room_down=room_down, sample_time=sample_time,
        )  # fmt: skip
        found = plan_test(wishes, "relay" if relay else "steps")
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    except NoLimitCycle as reason:
        typer.echo(str(reason))
        return REFUSED
    if as_json:
        typer.echo(json.dumps(plan_body(found), indent=1, allow_nan=False))
    else:
        typer.echo("\n".join(plan_sentences(found)))
    return 0
