"""The recommended loop analysed for a page: sensitivities, Nichols, root locus, poles, limits."""

from advice.analyse import Analysis, Task, analyse
from advice.analysis_words import limit_words, loop_words, pole_words, task_words
from advice.report.analysis_figures import analysis_figures
from advice.report.drawing import Figure
from advice.report.section import Section, section
from advice.tune import TuningCase

# A row of the page holds two figures of this height. [px]
TALL = 480
CAPTIONS = {
    "sensitivities": "|S| and |T|, |GS| from load to PV, |CS| from noise to output, with the "
    "profile's limit on Ms.",
    "nichols": "Nichols plot; L stays outside the loop around -180° and 0 dB.",
    "root_locus": "Closed-loop poles of the exact dead time as the gain goes from 0 up, and where "
    "they stand now.",
}


def analysis_of(case: TuningCase, *, task: Task, scan_time: float = 0.0) -> Analysis | None:
    """Analyse the recommended loop of a case; None where nothing is recommended.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    task : Task
        What the loop has to do.
    scan_time : float
        Scan time of the controller. [s]
    """
    best = case.best
    if case.process is None or best is None or best.proposal.pid is None:
        return None
    return analyse(
        case.process,
        best.proposal.pid,
        scan_time=scan_time,
        profile=case.profile.name,
        task=task,
        points=200,
    )


def analysis_sections(analysis: Analysis) -> list[Section]:
    """Draw an analysis and say its limits.

    Parameters
    ----------
    analysis : Analysis
        The recommended loop.
    """
    drawn = analysis_figures(analysis)
    pair = ["nichols"] + (["root_locus"] if "root_locus" in drawn else [])
    return [
        section(
            "Analysis of the recommended loop",
            {"sensitivities": (_of_height(drawn["sensitivities"]), CAPTIONS["sensitivities"])},
            sentences=[*loop_words(analysis), *analysis.notes],
        ),
        section(
            "Closed-loop poles",
            {name: (_of_height(drawn[name]), CAPTIONS[name]) for name in pair},
            sentences=pole_words(analysis),
        ),
        section(
            "Limits of performance",
            {},
            sentences=[*limit_words(analysis), *task_words(analysis)],
        ),
    ]


def _of_height(figure: Figure) -> Figure:
    layout = figure["layout"]
    assert isinstance(layout, dict)  # noqa: S101 - every drawing has one
    return {**figure, "layout": {**layout, "height": TALL}}
