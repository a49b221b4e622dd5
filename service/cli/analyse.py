"""`loopwright analyse`: a process and a controller in, everything the toolbox says of them out."""

import json
from typing import Annotated

import typer
from rich.console import Console

from advice.analyse import Analysis, Task
from advice.analyse import analyse as analyse_loop
from advice.analysis_body import analysis_body
from advice.display import digits, margins_words
from loop.errors import INFINITELY_MANY
from service.cli.stating import (
    CONTROLLER_HELP,
    PROCESS_HELP,
    controller_from_text,
    process_from_text,
)
from tuning.profiles import DEFAULT_PROFILE, PROFILES

MOST_POLES = 8


def analyse(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    controller: Annotated[str, typer.Argument(metavar="CONTROLLER", help=CONTROLLER_HELP)],
    profile: Annotated[
        str, typer.Option(metavar="NAME", help=f"Target profile: {', '.join(PROFILES)}.")
    ] = DEFAULT_PROFILE,
    scan_time: Annotated[
        float, typer.Option(metavar="S", help="Scan time of the controller in seconds.")
    ] = 0.0,
    load: Annotated[
        float | None, typer.Option(metavar="OP", help="Largest load step at the process input.")
    ] = None,
    allowed: Annotated[
        float | None, typer.Option(metavar="PV", help="Deviation of PV that may happen.")
    ] = None,
    frequency: Annotated[
        float | None, typer.Option(metavar="RAD/S", help="Highest frequency of the load.")
    ] = None,
    crossover: Annotated[
        float | None, typer.Option(metavar="RAD/S", help="Gain crossover wanted.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
) -> int:
    """Analyse a process with a controller: margins, poles, limits of performance, with dead time.

    Exit code 0: answered. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    pid = controller_from_text(controller, plant)
    if profile not in PROFILES:
        raise typer.BadParameter(f"--profile must be one of {', '.join(PROFILES)}, got {profile}")
    try:
        analysis = analyse_loop(
            plant, pid, scan_time=scan_time, profile=profile,
            task=Task(load=load, allowed=allowed, frequency=frequency, wc=crossover),
        )  # fmt: skip
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    if as_json:
        typer.echo(json.dumps(analysis_body(analysis), indent=1, allow_nan=False))
    else:
        _print(analysis)
    return 0


def _print(analysis: Analysis) -> None:
    out = Console(soft_wrap=True, highlight=False)
    for title, sentences in (
        ("Loop", _loop(analysis)),
        ("Closed-loop poles", _poles(analysis)),
        ("Limits of performance", _limits(analysis)),
        ("Task", _task(analysis)),
        ("Notes", list(analysis.notes)),
    ):
        if sentences:
            out.print(f"[bold]{title}[/bold]")
            for sentence in sentences:
                out.print(f"  {sentence}", markup=False)


def _loop(analysis: Analysis) -> list[str]:
    found, wide = analysis.margins, analysis.bandwidths
    if found is None:
        count = analysis.unstable
        said = "infinitely many" if count == INFINITELY_MANY else str(count)
        noun = "pole" if count == 1 else "poles"
        sentences = [f"Unstable: {said} {noun} right of the axis."]
    else:
        word = "keeps" if analysis.passes else "does not keep"
        sentences = [
            f"Stable: {margins_words(found)}.",
            f"At the model it {word} the profile {analysis.profile.name}.",
        ]
        if found.gain_reduction:
            sentences.append(
                f"Lost as well when the gain falls below {digits(found.gain_reduction, 3)} of it."
            )
    sentences.append(
        f"Crossover {digits(wide.wc, 3)} rad/s; bandwidth {digits(wide.S, 3)} rad/s (S), "
        f"{digits(wide.T, 3)} rad/s (T)."
    )
    if analysis.nyquist is not None:
        n = analysis.nyquist
        sentences.append(
            f"Nyquist: Z = N + P, {n.closed_loop} = {n.encirclements} + {n.open_loop}."
        )
    if analysis.bode is not None:
        sentences.append(
            f"Bode's integral of ln|S|: {analysis.bode.integral:.3g}, "
            f"by its law {analysis.bode.expected:.3g} rad/s."
        )
    return sentences + [item.sentence for item in analysis.stability.cancellations]


def _poles(analysis: Analysis) -> list[str]:
    if analysis.poles is None:
        return []
    shown = analysis.poles.poles[analysis.poles.poles.imag >= 0][:MOST_POLES]
    sentences = []
    for pole in shown:
        if pole.imag:
            damping = -pole.real / abs(pole)
            sentences.append(f"{pole.real:.5g} ± {pole.imag:.5g}j rad/s, damping {damping:.3g}")
        else:
            sentences.append(f"{pole.real:.5g} rad/s")
    if analysis.locus is not None:
        sentences += [
            f"On the axis at {w:.5g} rad/s with {k:.5g} times the gain."
            for k, w in analysis.locus.crossings
            if k > 0
        ][:3]
    return sentences


def _limits(analysis: Analysis) -> list[str]:
    phase = f"{analysis.profile.phase:g}°"
    sentences = [limit.sentence for limit in analysis.limits]
    sentences.append(
        f"With a phase margin of {phase} a PID crosses over at {digits(analysis.fastest, 3)} "
        "rad/s at most."
    )
    return sentences


def _task(analysis: Analysis) -> list[str]:
    sentences = []
    if analysis.feasibility is not None:
        verdict = "Nothing forbids" if analysis.feasibility.possible else "No PID can have"
        sentences += [f"{verdict} that crossover.", *analysis.feasibility.reasons]
    if analysis.peak is not None:
        sentences.append(analysis.peak.sentence)
    if analysis.window is not None:
        sentences += analysis.window.sentences
    sentences += [item.sentence for item in analysis.disturbances]
    sentences.append(analysis.beyond.sentence)
    for finding in analysis.beyond.findings:
        if finding.sentence not in sentences:
            sentences.append(finding.sentence)
        sentences.append(f"What would help: {'; '.join(finding.helps)}.")
    return sentences
