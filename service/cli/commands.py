"""Every command, in the order of `loopwright --help`."""

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

import typer

HELP = "Loop-performance monitoring and PID auto-tuning that shows its reasoning."


class Entry(NamedTuple):
    """One command, or one group of commands, and what `loopwright --help` says of it."""

    name: str
    place: str
    sentence: str


COMMANDS = (
    Entry(
        "tune",
        "service.cli.tune:tune",
        "Identify the process behind a test, tune it by every rule and verify the settings.",
    ),
    Entry(
        "propose",
        "service.cli.propose:propose",
        "Tune a process that is known already, by every rule, and verify the settings.",
    ),
    Entry(
        "identify",
        "service.cli.identify:identify",
        "Identify the process behind a test, with its errors and a verdict.",
    ),
    Entry(
        "frequency",
        "service.cli.frequency:frequency",
        "Read a chirp, sine steps or a multisine: response, model, margins without a model.",
    ),
    Entry(
        "repeats",
        "service.cli.repeats:repeats",
        "Pool repeated step tests of one loop, and say which of them does not belong.",
    ),
    Entry(
        "assess",
        "service.cli.assess:assess",
        "Assess routine data: what is wrong with each loop, how sure that is, and what to do next.",
    ),
    Entry(
        "compare",
        "service.cli.compare:compare",
        "Compare the control error of two periods of a file, such as before and after a change.",
    ),
    Entry(
        "scorecard",
        "service.cli.scorecard:scorecard",
        "Show how the plant stands after a job: areas, causes, and the loops that cost the most.",
    ),
    Entry(
        "overrule",
        "service.cli.scorecard:overrule",
        "Put your diagnosis in place of the computed one; both stay to be read.",
    ),
    Entry(
        "plantwide",
        "service.cli.plantwide:plantwide",
        "Find loops that oscillate together, where that likely begins, and cascades.",
    ),
    Entry(
        "analyse",
        "service.cli.analyse:analyse",
        "Analyse a process with a controller: margins, poles, limits of performance.",
    ),
    Entry(
        "region",
        "service.cli.region:region",
        "Turn a second-order specification into a region for the poles, and poles back.",
    ),
    Entry(
        "interaction",
        "service.cli.interaction:interaction",
        "Find the relative gains of a plant, and the pairing that interacts least.",
    ),
    Entry(
        "smooth",
        "service.cli.smooth:smooth",
        "Tune as slowly as a load permits: smooth tuning, and averaging level control.",
    ),
    Entry(
        "detune",
        "service.cli.detune:detune",
        "Choose settings by one knob from calm to fast, with the load area that each costs.",
    ),
    Entry(
        "condition",
        "service.cli.condition:condition",
        "Work out scan time, filters, N, b and Tt, and what noise does to the output.",
    ),
    Entry(
        "predictor",
        "service.cli.predictor:predictor",
        "Tune a Smith predictor and sweep the errors of its model.",
    ),
    Entry(
        "cascade",
        "service.cli.cascade:cascade",
        "Tune a cascade from inside out, sweep both loops, and hold it against a single loop.",
    ),
    Entry(
        "feedforward",
        "service.cli.feedforward:feedforward",
        "Work out the feed-forward of a measured load, and what it leaves.",
    ),
    Entry(
        "schedule",
        "service.cli.schedule:schedule",
        "Tune at every operating point, and say whether the points are close enough.",
    ),
    Entry(
        "simulate",
        "service.cli.simulate:simulate",
        "Simulate settings before they are typed: steps, loads, a record met again.",
    ),
    Entry(
        "export",
        "service.cli.exporting:export",
        "Write a process model as a short script for another tool.",
    ),
    Entry(
        "plan",
        "service.cli.plan:plan",
        "Plan a test by steps, by pulses (of an integrator) or by relay: moves, errors, limits.",
    ),
    Entry(
        "demo",
        "service.cli.demo:demo",
        "Start the service with a small simulated plant to look at.",
    ),
    Entry("serve", "service.cli.serve:serve", "Start the service."),
    Entry(
        "migrate",
        "service.cli.migrate:migrate",
        "Bring the database to the state this version needs.",
    ),
    Entry("key", "service.cli.keys:app", "Create, list and revoke API keys."),
    Entry(
        "import", "service.cli.importing:import_export", "Store an export as a record of a loop."
    ),
    Entry("sheet", "service.cli.sheets:app", "Show, compare, draft and approve loop sheets."),
    Entry("audit", "service.cli.audit:app", "Prove the audit trail intact, or take it away."),
)


def app_for(arguments: list[str]) -> typer.Typer:
    """Build the command line around the one command that is asked for.

    The others are there by name and sentence only: loading what all of them need takes seconds,
    and `loopwright --help` should not.

    Parameters
    ----------
    arguments : list of str
        The arguments of `loopwright`.
    """
    asked = next((argument for argument in arguments if not argument.startswith("-")), None)
    app = typer.Typer(
        name="loopwright",
        help=HELP,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    for entry in COMMANDS:
        if entry.name == asked:
            _add(app, entry)
        else:
            app.command(entry.name, short_help=entry.sentence)(_named_only)
    return app


def _add(app: typer.Typer, entry: Entry) -> None:
    """Load a command or a group of commands from its place, `module:name`."""
    module, _, name = entry.place.partition(":")
    found: typer.Typer | Callable[..., int] = getattr(import_module(module), name)
    if isinstance(found, typer.Typer):
        app.add_typer(found, name=entry.name, help=entry.sentence)
    else:
        app.command(entry.name, short_help=entry.sentence)(found)


def _named_only() -> None:
    """Stand for a command that nobody asked for."""
