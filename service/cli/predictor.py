"""`loopwright predictor`: a model with dead time in, a Smith predictor out."""

from typing import Annotated

import typer

from advice.predictor import predictor_body, predictor_case, predictor_sentences
from service.cli.answering import AsJson, answer
from service.cli.stating import first_order_from_text
from tuning.profiles import DEFAULT_PROFILE, PROFILES


def predictor(
    process: Annotated[
        str, typer.Argument(metavar="PROCESS", help="FOPDT:K,TAU,THETA, in seconds.")
    ],
    tau_c: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Closed-loop time constant after the dead time; the smallest that keeps the "
            "profile with each parameter off by up to 50 % if not given.",
        ),
    ] = None,
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    as_json: AsJson = False,
) -> int:
    """Tune a Smith predictor and sweep the errors of its model.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    model = first_order_from_text(process, "a Smith predictor")
    return answer(
        lambda: predictor_case(model, tau_c=tau_c, profile=profile),
        as_json=as_json,
        body=predictor_body,
        sentences=predictor_sentences,
    )
