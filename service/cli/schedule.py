"""`loopwright schedule`: models at operating points in, a schedule of settings out."""

from typing import Annotated

import typer

from advice.schedule import (
    DEFAULT_RULE,
    DEFAULT_STRUCTURE,
    schedule_body,
    schedule_for,
    schedule_sentences,
)
from loop.process import FOPDT
from service.cli.answering import AsJson, answer
from service.cli.stating import first_order_from_text
from tuning.profiles import DEFAULT_PROFILE, PROFILES


def schedule(
    points: Annotated[
        list[str],
        typer.Argument(
            metavar="AT=PROCESS...",
            help="Two or more operating points, such as 20=FOPDT:1,10,2 80=FOPDT:3,8,2.",
        ),
    ],
    rule: Annotated[
        str, typer.Option(metavar="NAME", help="Rule of the catalogue, such as simc.")
    ] = DEFAULT_RULE,
    structure: Annotated[
        str, typer.Option(metavar="NAME", help="One of its structures: P, PI, PD or PID.")
    ] = DEFAULT_STRUCTURE,
    tau_c: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Closed-loop time constant at every point; the rule's own, of SIMC twice the "
            "dead time, if not given.",
        ),
    ] = None,
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    as_json: AsJson = False,
) -> int:
    """Tune at every operating point, and say whether the points are close enough.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    stated = [_point(text) for text in points]
    return answer(
        lambda: schedule_for(stated, rule=rule, structure=structure, tau_c=tau_c, profile=profile),
        as_json=as_json,
        body=schedule_body,
        sentences=schedule_sentences,
    )


def _point(text: str) -> tuple[float, FOPDT]:
    at, _, process = text.partition("=")
    try:
        place = float(at)
    except ValueError as error:
        raise typer.BadParameter(
            f"an operating point is AT=FOPDT:K,TAU,THETA such as 20=FOPDT:1,10,2, got {text!r}"
        ) from error
    return place, first_order_from_text(process, "a schedule")
