"""`loopwright feedforward`: models of output and load in, the feed-forward out."""

from typing import Annotated

import typer

from advice.feed_forward import feed_forward_body, feed_forward_sentences
from service.cli.answering import AsJson, answer
from service.cli.stating import first_order_from_text
from tuning.feed_forward import LARGEST_RATIO, feed_forward


def feedforward(
    process: Annotated[
        str, typer.Argument(metavar="PROCESS", help="From OP to PV: FOPDT:K,TAU,THETA, seconds.")
    ],
    load: Annotated[
        str,
        typer.Argument(metavar="LOAD", help="From the measured load to PV: FOPDT:K,TAU,THETA."),
    ],
    largest_ratio: Annotated[
        float, typer.Option(metavar="X", help="Largest lead over lag.")
    ] = LARGEST_RATIO,
    as_json: AsJson = False,
) -> int:
    """Work out the feed-forward of a measured load, and what it leaves.

    Exit code 0: answered. 2: called wrongly. 1: failed.
    """
    plant = first_order_from_text(process, "feed-forward")
    disturbance = first_order_from_text(load, "feed-forward")
    return answer(
        lambda: feed_forward(plant, disturbance, largest_ratio=largest_ratio),
        as_json=as_json,
        body=lambda found: feed_forward_body(found, plant, disturbance),
        sentences=feed_forward_sentences,
    )
