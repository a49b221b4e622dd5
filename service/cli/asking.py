"""Options that commands share which answer with a whole case, and what they add to it."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from advice.analyse import Task
from advice.report.page import Asked, write_report
from advice.robust_body import optimal_words, proof_words
from advice.robust_choice import optimal_choices, prove_case
from advice.tune import TuningCase

Proof: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--proof",
        help="Prove the worst margins with all parameters off by up to 50 % at once.",
    ),
]
Optimal: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--optimal",
        help="Add the PI and PID of least load area that keep the profile over ±50 %, "
        "over what the record leaves open, and from calm to fast.",
    ),
]
Load: TypeAlias = Annotated[
    float | None,
    typer.Option(metavar="OP", help="Largest load step, for the limits in the HTML report."),
]
Allowed: TypeAlias = Annotated[
    float | None,
    typer.Option(metavar="PV", help="Deviation of PV that may happen, for the same."),
]
Report: TypeAlias = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write a self-contained HTML page, or one A4 page as .pdf."),
]


def worked_out(
    case: TuningCase,
    *,
    proof: bool,
    optimal: bool,
    scan_time: float,
    load: float | None = None,
    allowed: float | None = None,
) -> Asked:
    """Work out what was asked for beside the case.

    Parameters
    ----------
    case : TuningCase
        The case.
    proof, optimal : bool
        What was asked for.
    scan_time : float
        Scan time of the controller. [s]
    load, allowed : float, optional
        Largest load step and the deviation of PV that may happen. [OP], [PV]
    """
    return Asked(
        task=None if load is None else Task(load=load, allowed=allowed),
        scan_time=scan_time,
        proof=prove_case(case, scan_time=scan_time) if proof else None,
        choices=optimal_choices(case, scan_time=scan_time) if optimal else None,
    )


def print_asked(asked: Asked) -> None:
    """Print proofs and optimal settings in words."""
    for title, sentences in (
        ("Proof", [] if asked.proof is None else proof_words(asked.proof)),
        ("Optimal settings", [] if asked.choices is None else optimal_words(asked.choices)),
    ):
        if sentences:
            typer.echo("\n".join(("", title, *(f"  {sentence}" for sentence in sentences))))


def write_file(case: TuningCase, file: Path, *, title: str, asked: Asked) -> None:
    """Write the report in the kind that the name of the file asks for."""
    if file.suffix.lower() == ".pdf":
        # What sets and draws it takes a second to load: only who asks for it waits.
        from advice.report.one_page import write_pdf

        write_pdf(case, file, title=title)
    else:
        write_report(case, file, title=title, asked=asked)
