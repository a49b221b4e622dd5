"""`loopwright smooth`: a process and its largest load in, the slowest settings that hold out."""

from typing import Annotated

import typer

from advice.smooth import smooth_body, smooth_case, smooth_sentences
from service.cli.answering import AsJson, answer
from service.cli.stating import PROCESS_HELP, process_from_text
from tuning.profiles import DEFAULT_PROFILE, PROFILES


def smooth(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    load: Annotated[
        float, typer.Option(metavar="OP", help="Largest load step, as the output it takes.")
    ],
    allowed: Annotated[float, typer.Option(metavar="PV", help="Largest deviation of PV.")],
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    as_json: AsJson = False,
) -> int:
    """Tune as slowly as a load permits: smooth tuning, and averaging level control.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    return answer(
        lambda: smooth_case(plant, load=load, allowed=allowed, profile=profile),
        as_json=as_json,
        body=smooth_body,
        sentences=smooth_sentences,
    )
