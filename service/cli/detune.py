"""`loopwright detune`: a process and one knob in, settings with their price out."""

from enum import StrEnum
from typing import Annotated

import typer

from advice.detuning import detuning_body, detuning_case, detuning_sentences
from service.cli.answering import AsJson, answer
from service.cli.stating import PROCESS_HELP, process_from_text
from tuning.detuning import NAMED
from tuning.profiles import DEFAULT_PROFILE, PROFILES


class StructureName(StrEnum):
    """Terms in use."""

    PI = "PI"
    PID = "PID"


def detune(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    knob: Annotated[
        str, typer.Option(metavar="0..1", help=f"From calm to fast; or {', '.join(NAMED)}.")
    ] = "normal",
    structure: Annotated[StructureName, typer.Option(help="Terms in use.")] = StructureName.PI,
    gain: Annotated[
        float | None,
        typer.Option(metavar="OP/PV", help="Gain to detune an AMIGO PI to, FOPDT and IPDT."),
    ] = None,
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    scan_time: Annotated[
        float, typer.Option(metavar="S", help="Scan time of the controller in seconds.")
    ] = 0.0,
    as_json: AsJson = False,
) -> int:
    """Choose settings by one knob from calm to fast, with the load area that each costs.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    return answer(
        lambda: detuning_case(
            plant,
            _position(knob),
            structure=structure.value,
            gain=gain,
            profile=profile,
            scan_time=scan_time,
        ),
        as_json=as_json,
        body=detuning_body,
        sentences=detuning_sentences,
    )


def _position(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
