"""`loopwright identify`: a file in, a process model with its verdict out."""

import json
from typing import Annotated

import typer

from advice.bootstrap import bootstrap_body, bootstrap_words
from advice.case_body import case_model_body
from advice.tune import tune
from service.cli import reading
from service.cli.printing import print_model

REFUSED = 3


def identify(
    file: reading.ExportFile,
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    op_before: reading.OpBefore = None,
    sp: reading.SPColumn = None,
    mode: reading.ModeColumn = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the `model` of the document that tune prints.")
    ] = False,
    bootstrap: Annotated[
        bool,
        typer.Option(
            "--bootstrap", help="Add intervals from the test repeated with its own residual."
        ),
    ] = False,
    tag: reading.Tag = None,
    delimiter: reading.Delimiter = None,
    decimal: reading.Decimal = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
) -> int:
    """Identify the process behind a test, with its errors and a verdict.

    Exit code 0: answered. 3: refused, with the reasons. 2: called wrongly. 1: failed.
    """
    stated = reading.Stated(
        time=time, pv=pv, op=op, sp=sp, mode=mode, op_before=op_before, tag=tag,
        delimiter=delimiter, decimal=decimal, time_format=time_format, time_zone=time_zone,
        day_first=day_first, layout=layout, mode_code=mode_code,
    )  # fmt: skip
    record, export = reading.read_record(file, stated)
    case = tune(record)  # the same walk as `loopwright tune`, so that the two cannot disagree
    if as_json:
        body = case_model_body(case)
        if bootstrap and case.model is not None:
            body["bootstrap"] = bootstrap_body(case.model)
        typer.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        print_model(case, export, title=record.tag or file.name)
        if bootstrap and case.model is not None:
            typer.echo(
                "\n".join(("", "Bootstrap", *map("  {}".format, bootstrap_words(case.model))))
            )
    return REFUSED if case.refused else 0
