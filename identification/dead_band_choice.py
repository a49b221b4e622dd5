"""Whether a record speaks for a dead band of the valve, and the model that then goes with it."""

import math
from dataclasses import dataclass, replace

from identification.candidate import Candidate, Choice
from identification.candidates import DECISIVE, HALF, MATERIAL, choose
from identification.condense import Samples
from identification.dead_band import DeadBandFit, fit_dead_band, widened
from identification.disturbances import NEARLY_WHITE, Explanation, explain
from identification.experiment import Experiment

# Width, and what the first move lost of it.
PARAMETERS = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """A record as a process behind a valve.

    Attributes
    ----------
    explanation : Explanation
        First-order fit with what was decided about drift and start.
    choice : Choice
        Structure of the process.
    dead_band : DeadBandFit or None
        The valve's play; None where nothing calls for one, or nothing tells.
    taken : bool
        Whether the model stands behind that play.
    """

    explanation: Explanation
    choice: Choice
    dead_band: DeadBandFit | None = None
    taken: bool = False


def read_process(samples: Samples, experiment: Experiment) -> Reading:
    """Explain a record by a process alone, or by a valve with play before it.

    Play is looked for where the output is known move by move and the process alone leaves something
    systematic, and taken where it
    stands four standard errors from nothing, lowers the criterion by ten for its two parameters and
    takes away half of what is systematic.

    Parameters
    ----------
    samples : Samples
        Process values to fit.
    experiment : Experiment
        Output and its moves.
    """
    start = not experiment.stated_before
    explanation = explain(samples, experiment.held, experiment.steps, start_may_differ=start)
    choice = choose(samples, explanation, experiment.steps, experiment.spacing)
    alone = Reading(explanation=explanation, choice=choice)
    chosen = choice.chosen
    if not experiment.exact or (
        chosen.part <= MATERIAL and chosen.colour.inflation <= NEARLY_WHITE
    ):
        return alone
    band = fit_dead_band(samples, explanation.fit)
    for _ in range(2):  # what was taken for a drift without the play may be none with it
        if band is None or not band.certain:
            return replace(alone, dead_band=band)
        behind = explain(samples, band.stem, experiment.steps, start_may_differ=start)
        band = fit_dead_band(samples, replace(behind.fit, held=experiment.held))
    if band is None or not band.certain:
        return replace(alone, dead_band=band)
    behind = explain(samples, band.stem, experiment.steps, start_may_differ=start)
    behind = replace(behind, fit=widened(behind.fit, band))
    with_play = choose(samples, behind, experiment.steps, experiment.spacing)
    if not _called_for(chosen, with_play.chosen):
        return replace(alone, dead_band=band)
    return Reading(explanation=behind, choice=with_play, dead_band=band, taken=True)


def _called_for(alone: Candidate, behind: Candidate) -> bool:
    readings = alone.fit.freedom + alone.free
    independent = max(readings / behind.colour.inflation, 10.0)
    ratio = math.log(max(float(behind.fit.sse), 1e-300) / max(float(alone.fit.sse), 1e-300))
    gained = independent * ratio + PARAMETERS * math.log(independent)
    gained += (behind.free - alone.free) * math.log(independent)
    return gained < -DECISIVE and behind.part < HALF * max(alone.part, MATERIAL)
