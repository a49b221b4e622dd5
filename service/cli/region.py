"""`loopwright region`: a step response wanted in, the region for its poles out."""

from typing import Annotated

import typer

from advice.pole_region import Specification, region_body, region_case, region_sentences
from loop.second_order import SETTLED
from service.cli.answering import AsJson, answer


def region(
    overshoot: Annotated[
        float | None, typer.Option(metavar="%", help="Largest overshoot of the step.")
    ] = None,
    phase: Annotated[
        float | None, typer.Option(metavar="DEG", help="Smallest phase margin of the loop.")
    ] = None,
    settling: Annotated[
        float | None, typer.Option(metavar="S", help="Longest time to settle.")
    ] = None,
    rise: Annotated[
        float | None, typer.Option(metavar="S", help="Longest time from 10 to 90 %.")
    ] = None,
    band: Annotated[
        float, typer.Option(metavar="PART", help="Half-width of the settling band.")
    ] = SETTLED,
    pole: Annotated[
        list[str] | None,
        typer.Option(metavar="RE,IM", help="Pole to hold to it, in rad/s; repeatable."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Turn a second-order specification into a region for the poles, and poles back.

    Exit code 0: answered. 2: called wrongly. 1: failed.
    """
    poles = [_pole(text) for text in pole or ()]
    return answer(
        lambda: region_case(
            Specification(
                overshoot=None if overshoot is None else overshoot / 100,
                phase=phase, settling=settling, rise=rise, band=band,
            ),
            poles,
        ),
        as_json=as_json,
        body=region_body,
        sentences=region_sentences,
    )  # fmt: skip


def _pole(text: str) -> complex:
    real, _, imag = text.partition(",")
    try:
        return complex(float(real), float(imag or 0.0))
    except ValueError as error:
        raise typer.BadParameter(f"--pole takes RE,IM such as -1,2, got {text!r}") from error
