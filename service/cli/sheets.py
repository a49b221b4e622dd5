"""`loopwright sheet`: loop sheets shown, compared, drafted and approved."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Annotated, TypeAlias
from uuid import UUID

import typer
from pydantic import ValidationError
from sqlalchemy.orm import Session

from monitoring.before_after import Change
from service.actors import Role
from service.cli.compare import REFUSED, print_effect
from service.cli.installation import (
    DataFolder,
    acting,
    faults,
    loop_tagged,
    opened,
    settings_for,
    writing,
)
from service.cli.listing import moment, print_columns
from service.errors import NotFound
from service.samples import open_samples
from service.sheets import actions, store
from service.sheets.effect import effect_around
from service.sheets.evidence import stored_block
from service.sheets.proposal import proposed_settings
from service.sheets.schemas import DecisionRequest, NewSheet
from service.sheets.store import Sheet
from service.tables import LoopRow

app = typer.Typer()
LoopTag: TypeAlias = Annotated[str, typer.Argument(metavar="TAG", help="Tag of the loop.")]
Why: TypeAlias = Annotated[str, typer.Option("--reason", metavar="TEXT", help="Why.")]


@app.command()
def show(
    tag: LoopTag,
    version: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Version; by default the one in force."),
    ] = None,
    data: DataFolder = None,
) -> int:
    """Show one version: its settings, the margins they keep, who wrote it, who decided."""
    with opened(settings_for(data=data)) as held, held.readings() as session:
        loop = loop_tagged(session, tag)
        _print(loop, _wanted(session, loop, version))
    return 0


@app.command()
def history(tag: LoopTag, data: DataFolder = None) -> int:
    """List all versions, newest first, with what became of each."""
    with opened(settings_for(data=data)) as held, held.readings() as session:
        sheets = store.newest_sheets(
            session, loop_tagged(session, tag).id, below=None, limit=100_000
        )
    print_columns(
        ("VERSION", "STATUS", "WRITTEN", "BY", "DECIDED", "BY", "REASON"),
        [
            (
                str(sheet.row.version),
                sheet.status,
                moment(sheet.row.created_at),
                sheet.row.author,
                moment(sheet.decision.created_at if sheet.decision else None),
                sheet.decision.author if sheet.decision else "-",
                " ".join(sheet.row.reason.split()),
            )
            for sheet in sheets
        ],
    )
    return 0


@app.command()
def diff(
    tag: LoopTag,
    before: Annotated[int, typer.Argument(metavar="FROM", min=1, help="Earlier version.")],
    after: Annotated[int, typer.Argument(metavar="TO", min=1, help="Later version.")],
    data: DataFolder = None,
) -> int:
    """Compare two versions field by field."""
    with opened(settings_for(data=data)) as held, held.readings() as session:
        loop = loop_tagged(session, tag)
        changes = actions.differences(
            store.sheet_with_version(session, loop.id, before).row,
            store.sheet_with_version(session, loop.id, after).row,
        )
    if not changes:
        typer.echo(f"Versions {before} and {after} of {tag} do not differ.")
        return 0
    width = max(len(field) for field, _, _ in changes)
    for field, old, new in changes:
        typer.echo(f"{field:{width}}  {_shown(old)} -> {_shown(new)}")
    return 0


@app.command()
def draft(
    tag: LoopTag,
    tuning: Annotated[
        UUID, typer.Option(metavar="ID", help="Tuning of this loop to take the settings from.")
    ],
    reason: Why,
    rule: Annotated[
        str | None, typer.Option(metavar="NAME", help="Rule; by default the recommended one.")
    ] = None,
    structure: Annotated[
        str | None, typer.Option(metavar="NAME", help="P, PI or PID, with --rule.")
    ] = None,
    data: DataFolder = None,
) -> int:
    """Draft a new version from a tuning, in the loop's own form and units.

    LOOPWRIGHT_KEY holds your API key, of an engineer or higher.
    """
    with opened(settings_for(data=data)) as held:
        actor = acting(held, Role.ENGINEER)
        with writing(held) as session:
            loop = loop_tagged(session, tag)
            proposed = proposed_settings(session, loop.id, tuning, rule=rule, structure=structure)
            try:
                new = NewSheet(settings=proposed.settings, tuning_id=tuning, reason=reason)
            except ValidationError as error:
                raise typer.BadParameter(f"--{'; '.join(faults(error))}") from error
            sheet = actions.draft_sheet(session, actor=actor, loop_id=loop.id, new=new)
        _print(loop, sheet)
    return 0


@app.command()
def approve(
    tag: LoopTag,
    version: Annotated[int, typer.Argument(metavar="VERSION", min=1, help="Draft to approve.")],
    reason: Why,
    data: DataFolder = None,
) -> int:
    """Put a draft in force; the version in force before is superseded.

    LOOPWRIGHT_KEY holds your API key, of an approver or higher. Who wrote the draft may not approve
    it, unless LOOPWRIGHT_ALLOW_SELF_APPROVAL says so.
    """
    try:
        request = DecisionRequest(reason=reason)
    except ValidationError as error:
        raise typer.BadParameter(f"--{'; '.join(faults(error))}") from error
    settings = settings_for(data=data)
    with opened(settings) as held:
        actor = acting(held, Role.APPROVER)
        with writing(held) as session:
            loop = loop_tagged(session, tag)
            sheet = actions.approve_sheet(
                session,
                actor=actor,
                loop_id=loop.id,
                version=version,
                # Versions never change: naming one says which text the decision is about.
                if_match="*",
                reason=request.reason,
                allow_self_approval=settings.allow_self_approval,
            )
        _print(loop, sheet)
    return 0


@app.command("effect")
def effect_of(
    tag: LoopTag,
    version: Annotated[int, typer.Argument(metavar="VERSION", min=1, help="Approved version.")],
    days: Annotated[
        float, typer.Option(min=0.001, max=31, help="Length of each period, at most, in days.")
    ] = 7.0,
    changed_at: Annotated[
        datetime | None,
        typer.Option(
            formats=["%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M", "%Y-%m-%d"],
            metavar="INSTANT",
            help="When the settings were typed in (UTC); by default when they were approved.",
        ),
    ] = None,
    data: DataFolder = None,
) -> int:
    """Ask whether a version helped: the control error before and after it came into force.

    Exit code 0: answered. 3: the periods cannot be compared, with the reason.
    """
    settings = settings_for(data=data)
    with opened(settings) as held, held.readings() as session:
        found = effect_around(
            session,
            open_samples(settings),
            loop_tagged(session, tag).id,
            version,
            span=timedelta(days=days),
            changed_at=None if changed_at is None else changed_at.replace(tzinfo=UTC),
        )
    typer.echo(f"{tag}, version {version}, changed at {moment(found.changed_at)}")
    print_effect(found.effect)
    return REFUSED if found.effect.comparison.change is Change.NOT_COMPARABLE else 0


def _wanted(session: Session, loop: LoopRow, version: int | None) -> Sheet:
    if version is not None:
        return store.sheet_with_version(session, loop.id, version)
    sheet = store.current_sheet(session, loop.id)
    if sheet is None:
        raise NotFound("approved sheet of loop", loop.tag)
    return sheet


def _print(loop: LoopRow, sheet: Sheet) -> None:
    row = sheet.row
    typer.echo(f"{loop.tag}, {loop.description}" if loop.description else loop.tag)
    typer.echo(f"Version {row.version}, {sheet.status}, profile {row.profile}")
    typer.echo(f"  written {moment(row.created_at)} by {row.author}: {row.reason}")
    if sheet.decision is not None:
        done = sheet.decision
        typer.echo(f"  {done.decision} {moment(done.created_at)} by {done.author}: {done.reason}")
    units = stored_block(row.block).units()
    typer.echo(f"Settings, {row.block['form']} form, {row.block['action']} acting")
    for name, value in row.settings.items():
        if name != "form":
            unit = "" if value is None else units.get(name, "")
            typer.echo(f"  {name:12}  {_shown(value)} {unit}".rstrip())
    if row.process is None or row.evidence is None:
        typer.echo("No process model is linked, so there are no margins.")
        return
    process = {**row.process}
    kind = process.pop("kind", "process")
    words = ", ".join(f"{name} {_shown(value)}" for name, value in process.items())
    typer.echo(f"Margins at {kind} {words}")
    margins = row.evidence["margins"]
    for name, value in margins.items() if isinstance(margins, Mapping) else ():
        typer.echo(f"  {name:14}  {'infinite' if value is None else _shown(value)}")
    typer.echo(f"  {row.evidence['verdict']}")


def _shown(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
