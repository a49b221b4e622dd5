"""`loopwright interaction`: static gains of a plant in, relative gains and a pairing out."""

from typing import Annotated

import typer

from advice.interaction import interaction_body, interaction_case, interaction_sentences
from service.cli.answering import AsJson, answer


def interaction(
    gains: Annotated[
        str,
        typer.Argument(
            metavar="GAINS",
            help="Static gains, a row a PV and a column an OP, such as 12.8,-18.9/6.6,-19.4.",
        ),
    ],
    as_json: AsJson = False,
) -> int:
    """Find the relative gains of a plant, and the pairing that interacts least.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    try:
        rows = [[float(part) for part in row.split(",")] for row in gains.split("/")]
    except ValueError as error:
        raise typer.BadParameter(
            f"gains are rows of numbers such as 12.8,-18.9/6.6,-19.4, got {gains!r}"
        ) from error
    return answer(
        lambda: interaction_case(rows),
        as_json=as_json,
        body=interaction_body,
        sentences=interaction_sentences,
    )
