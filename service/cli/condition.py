"""`loopwright condition`: a process and a controller in, the details around the settings out."""

from pathlib import Path
from typing import Annotated

import typer

from advice.conditioning import Conditioning, MeasuredNoise, Wanted, conditioning, measured_noise
from advice.conditioning_body import conditioning_body, conditioning_sentences
from service.cli import reading
from service.cli.answering import AsJson, answer
from service.cli.stating import (
    CONTROLLER_HELP,
    PROCESS_HELP,
    controller_from_text,
    process_from_text,
)
from tuning.conditioning import PHASE_COST


def condition(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    controller: Annotated[str, typer.Argument(metavar="CONTROLLER", help=CONTROLLER_HELP)],
    scan_time: Annotated[
        float | None,
        typer.Option(metavar="S", help="Scan time; the longest within the cost if not given."),
    ] = None,
    computation: Annotated[
        float, typer.Option(metavar="S", help="Delay from reading PV to writing the output.")
    ] = 0.0,
    noise: Annotated[
        float | None, typer.Option(metavar="PV", help="Standard deviation of the sensor's noise.")
    ] = None,
    noise_from: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Export to measure that noise in.")
    ] = None,
    travel: Annotated[
        float | None,
        typer.Option(metavar="OP", help="Sum of the output's moves in a day that noise may cause."),
    ] = None,
    phase_cost: Annotated[
        float,
        typer.Option(metavar="DEG", help="Phase that a scan, and again a filter, may cost."),
    ] = PHASE_COST,
    overshoot: Annotated[
        float, typer.Option(metavar="%", help="Overshoot of a set-point step that may be.")
    ] = 5.0,
    attenuation: Annotated[
        float, typer.Option(metavar="GAIN", help="Anti-alias filter at half the scan rate.")
    ] = 0.1,
    order: Annotated[int, typer.Option(metavar="1|2", help="Order of the anti-alias filter.")] = 2,
    swing: Annotated[
        float | None,
        typer.Option(metavar="RAD/S", help="Frequency of a swing to look for in the samples."),
    ] = None,
    as_json: AsJson = False,
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    tag: reading.Tag = None,
) -> int:
    """Work out scan time, filters, N, b and Tt, and what noise does to the output.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    pid = controller_from_text(controller, plant)
    if noise is not None and noise_from is not None:
        raise typer.BadParameter("give either --noise or --noise-from")
    stated = reading.Stated(time=time, pv=pv, op=op, tag=tag)

    def ask() -> tuple[Conditioning, MeasuredNoise | None]:
        measured = None
        if noise_from is not None:
            measured = measured_noise(reading.read_record(noise_from, stated)[0])
        found = conditioning(
            plant,
            pid,
            Wanted(
                scan_time=scan_time,
                computation=computation,
                noise=noise if measured is None else measured.sd,
                travel=travel,
                phase_cost=phase_cost,
                overshoot=overshoot,
                attenuation=attenuation,
                order=order,
                swing=swing,
            ),
        )
        return found, measured

    return answer(
        ask,
        as_json=as_json,
        body=lambda pair: conditioning_body(*pair),
        sentences=lambda pair: conditioning_sentences(*pair),
    )
