"""`loopwright cascade`: two models in, both controllers of a cascade out."""

from typing import Annotated

import typer

from advice.cascade import cascade_body, cascade_case, cascade_sentences
from service.cli.answering import AsJson, answer
from service.cli.stating import first_order_from_text
from tuning.profiles import DEFAULT_PROFILE, PROFILES


def cascade(
    inner: Annotated[
        str,
        typer.Argument(metavar="INNER", help="From OP to the inner PV: FOPDT:K,TAU,THETA in s."),
    ],
    outer: Annotated[
        str,
        typer.Argument(metavar="OUTER", help="From the inner PV to the outer: FOPDT:K,TAU,THETA."),
    ],
    inner_tau_c: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Closed-loop time constant of the inner loop; the smallest that keeps the "
            "profile if not given.",
        ),
    ] = None,
    outer_tau_c: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Closed-loop time constant of the outer loop; the smallest that keeps the "
            "profile on the true inner loop if not given.",
        ),
    ] = None,
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    as_json: AsJson = False,
) -> int:
    """Tune a cascade from inside out, sweep both loops, and hold it against a single loop.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    within = first_order_from_text(inner, "a cascade")
    around = first_order_from_text(outer, "a cascade")
    return answer(
        lambda: cascade_case(
            within, around, inner_tau_c=inner_tau_c, outer_tau_c=outer_tau_c, profile=profile
        ),
        as_json=as_json,
        body=cascade_body,
        sentences=cascade_sentences,
    )
