"""Say in words what was decided about a file and what was noticed in it."""

from collections.abc import Mapping

from historian.accounting import Ledger
from historian.export import Decisions, LoopSamples
from historian.options import Layout
from historian.plan import Plan

_DELIMITERS = {";": "semicolon", ",": "comma", "\t": "tab", "|": "bar", " ": "blank"}
_GROUPS = {"": "nothing", ",": "comma", ".": "point", " ": "blank", "'": "apostrophe"}
_LAYOUTS = {
    Layout.WIDE: "wide: a row is one instant",
    Layout.LONG: "long: a row is one sample of one tag",
    Layout.PAIRS: "pairs: every tag has its own time column",
}


def decisions_of(plan: Plan, remarks: tuple[str, ...] = ()) -> Decisions:
    """State all decisions of a plan, as values and in words."""
    table, time = plan.table, plan.time
    zone = plan.options.time_zone
    if time.is_elapsed:
        zone, zone_words = None, "elapsed time, so no time zone is needed"
    elif time.is_utc:
        zone, zone_words = "UTC", "UTC, as the times state it"
    elif zone is None:
        zone_words = "not stated; state it with time_zone=... to know the instants in UTC"
    else:
        zone_words = f"{zone}, as stated"
    names = tuple(table.names[column] for column in plan.assignment.times[0].columns)
    header = f"line {table.header_line}" if table.header_line is not None else "none"
    words = [
        f"container: {plan.container}",
        f"encoding: {plan.encoding.words}",
        f"separator: {_DELIMITERS.get(table.delimiter, table.delimiter)}",
        f"decimal mark: {'comma' if plan.numbers.decimal == ',' else 'point'}, "
        f"digits grouped by {_GROUPS[plan.numbers.thousands]}",
        f"layout: {_LAYOUTS[plan.assignment.layout]}",
        f"headings: {header}, first sample: line {table.first_line}",
        f"time: column {' and '.join(map(repr, names))}, {time.words} (first: {time.example!r})",
        f"time zone: {zone_words}",
        *(f"quality in column {table.names[c]!r}: {s.value}" for c, s in plan.schemes.items()),
        *(f"column {name!r} is not read: {why}" for name, why in plan.assignment.ignored),
        *table.notes,
        *remarks,
    ]
    return Decisions(
        container=plan.container,
        encoding=plan.encoding.name,
        line_end=plan.encoding.line_end,
        delimiter=table.delimiter,
        decimal=plan.numbers.decimal,
        thousands=plan.numbers.thousands,
        layout=plan.assignment.layout,
        header_line=table.header_line,
        first_line=table.first_line,
        columns=table.names,
        time_columns=names,
        time_format=time.name,
        time_zone=zone,
        words=tuple(words),
    )


def remarks(ledger: Ledger, loops: Mapping[str, LoopSamples]) -> tuple[str, ...]:
    """Say what the walk through the file noticed."""
    found = [f"passed over: {count} {what}" for what, count in ledger.passed_over.items() if count]
    found += [
        f"mode {word!r} ({count} rows) is UNKNOWN; state its meaning with mode_codes"
        for word, count in ledger.unknown_modes.items()
        if count
    ]
    zeroed = sum(ledger.zeroed.values())
    if zeroed:
        found.append(f"{zeroed} numbers below single precision are read as zero")
    found += [
        f"loop {name!r}: {', '.join(loop.held)} have other times than pv; their last value is held"
        for name, loop in loops.items()
        if loop.held
    ]
    if ledger.unterminated:
        found.append(
            "the last line has no line end; if the file was cut off, its last value may be "
            "incomplete"
        )
    return tuple(found)
