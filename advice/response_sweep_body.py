"""The sweep of a predictor or a cascade as JSON: every margin, the worst ones, the verdict."""

import numpy as np

from advice.body import Body, margins_body, number, numbers
from tuning.response_sweep import ResponseSweep, SweepVerdict
from tuning.shortfall import MARGIN_NAMES


def response_sweep_body(sweep: ResponseSweep, verdict: SweepVerdict) -> Body:
    """Margins at the model and while one parameter at a time is off.

    Parameters
    ----------
    sweep : ResponseSweep
        The margins.
    verdict : SweepVerdict
        Whether they keep the profile.
    """
    rows = list(sweep.swept.values())
    worst: Body = {}
    columns: Body = {}
    for name, (_, small_is_bad) in MARGIN_NAMES.items():
        values = np.array([[getattr(found, name) for found in row] for row in rows])
        columns[name] = numbers(values)
        row, column = np.unravel_index(
            np.argmin(values) if small_is_bad else np.argmax(values), values.shape
        )
        worst[name] = {
            "value": number(values[row, column]),
            "parameter": tuple(sweep.swept)[row],
            "factor": sweep.factors[column],
        }
    return {
        "margins": margins_body(sweep.nominal),
        "sweep": {
            "parameters": list(sweep.swept),
            "factors": list(sweep.factors),
            "stable": [[found.gain > 0 for found in row] for row in rows],
            **columns,
            "worst": worst,
        },
        "passes": verdict.passes,
        "verdict": verdict.sentence,
    }
