"""`loopwright repeats`: several step tests of one loop in, what they say together out."""

import json
from pathlib import Path
from typing import Annotated

import typer

from advice.display import digits
from advice.repeats import repeats_body, repeats_case, repeats_sentences
from loop.errors import FitNotTrusted
from service.cli import reading

REFUSED = 3


def repeats(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILES", help="Historian exports, one step test each."),
    ],
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    op_before: reading.OpBefore = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
    tag: reading.Tag = None,
) -> int:
    """Pool repeated step tests of one loop, and say which of them does not belong.

    Exit code 0: pooled. 3: fewer than two tests carry a model. 2: called wrongly. 1: failed.
    """
    stated = reading.Stated(time=time, pv=pv, op=op, op_before=op_before, tag=tag)
    records = [reading.read_record(file, stated)[0] for file in files]
    try:
        case = repeats_case(records)
    except FitNotTrusted as fact:
        typer.echo(json.dumps({"refused": str(fact)}) if as_json else str(fact))
        return REFUSED
    if as_json:
        typer.echo(json.dumps(repeats_body(case), indent=1, allow_nan=False))
        return 0
    for sentence in repeats_sentences(case):
        typer.echo(sentence)
    found = case.pooled
    for test in found.left_out:
        typer.echo(f"left out: {files[test.index].name}: {test.reason}")
    p = found.process
    typer.echo(f"K {digits(p.K)}, tau {digits(p.tau)} s, theta {digits(p.theta)} s")
    return 0
