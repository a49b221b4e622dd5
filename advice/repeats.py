"""The one walk from repeated tests of a loop to what they say together: pool, drift, linearity."""

from collections.abc import Sequence
from dataclasses import dataclass

from advice.body import Body, number, process_body
from identification.identify import identify
from identification.repeats import NAMES, LevelEffect, Repeats, gain_over_level, pool
from loop.errors import FitNotTrusted
from loop.record import Record


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RepeatsCase:
    """Repeated tests of one loop.

    Attributes
    ----------
    pooled : Repeats
        Model of all that count, the spread, what drifts.
    level : LevelEffect or None
        Whether the gain depends on where OP stood; None where the tests cannot tell.
    """

    pooled: Repeats
    level: LevelEffect | None


def repeats_case(records: Sequence[Record]) -> RepeatsCase:
    """Identify every test and take them together.

    Where every record says when it began, a drift of the process over these dates is looked for.

    Parameters
    ----------
    records : sequence of Record
        One step test each.

    Raises
    ------
    FitNotTrusted
        Fewer than two tests carry a first-order model.
    """
    models = [identify(record) for record in records]
    starts = [record.start.timestamp() for record in records if record.start is not None]
    pooled = pool(models, times=starts if len(starts) == len(records) else None)
    try:
        level = gain_over_level(models)
    except FitNotTrusted:
        level = None
    return RepeatsCase(pooled=pooled, level=level)


def repeats_sentences(case: RepeatsCase) -> list[str]:
    """What the tests say together, for people."""
    return [*case.pooled.notes, *([] if case.level is None else [case.level.sentence])]


def repeats_body(case: RepeatsCase) -> Body:
    """Pooled model, errors, spread, drift, linearity, and the tests that do not count.

    Trends are per second and null where chance explains them.
    """
    found, level = case.pooled, case.level
    trends = None if found.trends is None else map(number, found.trends.tolist())
    return {
        "process": process_body(found.process),
        "standard_errors": dict(
            zip(NAMES, map(number, found.standard_errors.tolist()), strict=True)
        ),
        "spread": dict(zip(NAMES, map(number, found.spread.tolist()), strict=True)),
        "used": list(found.used),
        "left_out": [{"test": test.index, "reason": test.reason} for test in found.left_out],
        "trends": None if trends is None else dict(zip(NAMES, trends, strict=True)),
        "gain_over_level": None
        if level is None
        else {
            "slope": number(level.slope),
            "slope_error": number(level.slope_error),
            "low": number(level.low),
            "high": number(level.high),
            "certain": level.certain,
        },
        "notes": list(repeats_sentences(case)),
    }
