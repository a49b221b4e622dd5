"""`loopwright scorecard` and `loopwright overrule`: how the plant stands, and what people say."""

import json
from typing import Annotated
from uuid import UUID

import typer
from pydantic import ValidationError

from advice.display import digits
from advice.rollup import Order, PlantScorecard, Rollup
from service.actors import Role
from service.assessments import actions
from service.assessments.schemas import Overrule, ScorecardBody
from service.cli.installation import DataFolder, acting, faults, opened, settings_for, writing
from service.cli.listing import print_columns
from service.errors import NotFound

REFUSED = 3


def scorecard(
    job: Annotated[
        UUID | None, typer.Option(metavar="ID", help="Job; by default that of the latest period.")
    ] = None,
    by: Annotated[
        Order, typer.Option(help="What makes one bad actor worse than another.")
    ] = Order.LOSS,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
    data: DataFolder = None,
) -> int:
    """Show how the plant stands after a job: areas, causes, and the loops that cost the most.

    Exit code 0: answered. 3: nothing has been assessed yet. 2: called wrongly. 1: failed.
    """
    with opened(settings_for(data=data)) as held, held.readings() as session:
        try:
            found, card = actions.scorecard(session, job, by)
        except NotFound as reason:
            typer.echo(str(reason), err=True)
            return REFUSED
    if as_json:
        body = ScorecardBody.of(found, card).model_dump(mode="json")
        typer.echo(json.dumps(body, indent=1, allow_nan=False))
    else:
        _print(card)
    return 0


def overrule(
    assessment: Annotated[
        UUID, typer.Argument(metavar="ASSESSMENT", help="Id, as the scorecard lists it.")
    ],
    cause: Annotated[str, typer.Option(metavar="CAUSE", help="What is wrong with the loop.")],
    reason: Annotated[str, typer.Option(metavar="TEXT", help="How you know.")],
    data: DataFolder = None,
) -> int:
    """Put your diagnosis in place of the computed one; both stay to be read.

    LOOPWRIGHT_KEY holds your API key, of an engineer or higher.
    """
    try:
        said = Overrule.model_validate({"cause": cause, "reason": reason})
    except ValidationError as error:
        raise typer.BadParameter(f"--{'; '.join(faults(error))}") from error
    with opened(settings_for(data=data)) as held:
        actor = acting(held, Role.ENGINEER)
        with writing(held) as session:
            found = actions.overrule(session, actor=actor, assessment_id=assessment, said=said)
            computed = found.row.cause
    typer.echo(f"{assessment}: {said.cause} in place of {computed}")
    return 0


def _print(card: PlantScorecard) -> None:
    print_columns(
        ("Area", "Loops", "Assessable", "Grade", "Cost a day", "Causes"),
        [_line("the plant", card.plant), *(_line(area.name or "-", area) for area in card.areas)],
    )
    typer.echo("\nWorst first")
    print_columns(
        ("Loop", "Area", "Grade", "Cause", "Loss", "Cost a day", "Assessment"),
        [
            (
                bad.tag,
                bad.area or "-",
                "-" if bad.points is None else f"{bad.points:.0f}",
                bad.cause,
                digits(bad.loss),
                _money(bad.cost),
                bad.name,
            )
            for bad in card.bad_actors
        ],
    )


def _line(name: str, line: Rollup) -> tuple[str, ...]:
    causes = ", ".join(f"{count} {cause}" for cause, count in line.causes)
    grade = "-" if line.points is None else f"{line.points:.0f}"
    return (name, str(line.loops), str(line.assessable), grade, _money(line.cost), causes)


def _money(cost: float | None) -> str:
    return "-" if cost is None else digits(cost)
