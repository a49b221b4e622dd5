"""`loopwright frequency`: a frequency test in; measured response, model and margins out."""

import json
import math
from typing import Annotated

import typer
from rich.console import Console

from advice.display import digits
from advice.frequency import FrequencyCase, frequency_body, frequency_case
from loop.controller import PID
from loop.errors import PoorExcitation
from service.cli import reading
from service.cli.listing import print_columns

REFUSED = 3
MOST_POINTS = 20  # on a terminal; --json has them all


def frequency(
    file: reading.ExportFile,
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="KC,TI,TD",
            help="Settings whose margins are wanted (ISA, seconds; TI may be inf).",
        ),
    ] = None,
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
    tag: reading.Tag = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
) -> int:
    """Read a chirp, sine steps or a multisine: response, model, margins without a model.

    Exit code 0: answered. 3: refused, with the reason. 2: called wrongly. 1: failed.
    """
    stated = reading.Stated(
        time=time, pv=pv, op=op, tag=tag, time_format=time_format, time_zone=time_zone,
        day_first=day_first, layout=layout,
    )  # fmt: skip
    settings = None if controller is None else _settings(controller)
    record, _ = reading.read_record(file, stated)
    try:
        case = frequency_case(record, settings)
    except PoorExcitation as reason:
        typer.echo(json.dumps({"refusal": str(reason)}) if as_json else f"Refused: {reason}")
        return REFUSED
    if as_json:
        typer.echo(json.dumps(frequency_body(case), indent=1, allow_nan=False))
    else:
        _print(case)
    return 0


def _settings(text: str) -> PID:
    try:
        Kc, Ti, Td = (float(part) for part in text.split(","))
        return PID(Kc=Kc, Ti=Ti if Ti > 0 else math.inf, Td=Td)
    except ValueError as error:
        raise typer.BadParameter(
            f"--controller takes KC,TI,TD such as 0.8,120,0, got {text!r}"
        ) from error


def _print(case: FrequencyCase) -> None:
    points = case.response
    stride = max(1, -(-points.w.size // MOST_POINTS))
    rows = [
        (
            digits(w),
            digits(abs(G)),
            f"{_degrees(G):.1f}",
            digits(2 * sd / abs(G) * 100, 2),
            f"{c:.3f}",
        )
        for w, G, sd, c in zip(
            points.w[::stride].tolist(),
            points.G[::stride].tolist(),
            points.sd[::stride].tolist(),
            points.coherence[::stride].tolist(),
            strict=True,
        )
    ]
    print_columns(("w [rad/s]", "|G| [PV/OP]", "angle [°]", "± [%]", "coherence"), rows)
    out = Console(soft_wrap=True, highlight=False)
    if case.fit is None:
        out.print(f"\nNo model: {case.refusal}", markup=False)
    else:
        p, (K, tau, theta) = case.fit.process, (digits(2 * e, 2) for e in case.fit.standard_errors)
        out.print(
            f"\nModel: K {digits(p.K)} ± {K}, tau {digits(p.tau)} ± {tau} s, "
            f"theta {digits(p.theta)} ± {theta} s, "
            f"misfit {digits(case.fit.misfit, 3)} (1: as the noise says)",
            markup=False,
        )
    if case.margins is not None:
        for name, value, unit in (
            ("gain margin", case.margins.gain, ""),
            ("phase margin", case.margins.phase, "°"),
            ("Ms", case.margins.Ms, ""),
        ):
            said = (
                "not within the measured frequencies"
                if value is None
                else f"{digits(value[0], 3)}{unit} ({digits(value[1], 3)} to {digits(value[2], 3)})"
            )
            out.print(f"{name}: {said}", markup=False)
        for remark in case.margins.remarks:
            out.print(f"  {remark}", markup=False)


def _degrees(G: complex) -> float:
    return math.degrees(math.atan2(G.imag, G.real))
