"""Pooled repeats of one test as a JSON document."""

from advice.body import Body, number, process_body
from identification.repeats import NAMES, Repeats


def repeats_body(found: Repeats) -> Body:
    """Pooled model, its errors, the spread between tests, and the tests that do not count."""
    return {
        "process": process_body(found.process),
        "standard_errors": dict(
            zip(NAMES, map(number, found.standard_errors.tolist()), strict=True)
        ),
        "spread": dict(zip(NAMES, map(number, found.spread.tolist()), strict=True)),
        "used": list(found.used),
        "left_out": [{"test": test.index, "reason": test.reason} for test in found.left_out],
        "notes": list(found.notes),
    }
