"""From streams to an export: instants in UTC, rows in order, loops with their accounting."""

from collections import Counter
from collections.abc import Iterable

import numpy as np

from historian.accounting import Accounting, Ledger
from historian.errors import ExportRefused
from historian.export import Export, LoopSamples, TagSignal, as_times
from historian.loops import Membership, as_codes, as_numbers, find_members, held_on
from historian.options import Layout
from historian.plan import Plan
from historian.sentences import decisions_of, remarks
from historian.series import Series, Spacing, in_order, spacing_of
from historian.streams import Stream, Values
from historian.tag_map import Part
from historian.timestamps import SECOND
from historian.zones import to_utc, zone_named


class Assembly:
    """Put an export together.

    Parameters
    ----------
    plan : Plan
        What was decided.
    ledger : Ledger
        What the walk noted.
    """

    def __init__(self, plan: Plan, ledger: Ledger) -> None:
        self._plan = plan
        self._ledger = ledger
        self._units = {s.tag: s.unit for s in plan.assignment.signals}
        self._modes = {s.tag for s in plan.assignment.signals if s.is_mode}
        self._signals: dict[str, TagSignal] = {}
        self._settled: dict[str, Series] = {}
        self._spacings: dict[str, Spacing] = {}
        self._steps_back = False
        self._zone = None
        if plan.options.time_zone is not None:
            self._zone = zone_named(plan.options.time_zone)

    @property
    def _shared(self) -> bool:
        return self._plan.assignment.layout is Layout.WIDE

    @property
    def time_zone(self) -> str | None:
        """Zone in which instants are known."""
        if self._plan.time.is_elapsed:
            return None
        return "UTC" if self._plan.time.is_utc else self._plan.options.time_zone

    def add(self, stream: Stream) -> None:
        """Settle one stream."""
        if self._plan.time.name == "clock":
            self._refuse_midnight(stream)
        tags = tuple(stream.values)
        if self._zone is not None and not (self._plan.time.is_utc or self._plan.time.is_elapsed):
            self._to_utc(stream, "" if self._shared else tags[0])
        series = in_order(stream.instants, stream.values)
        if series.disordered and any(series.conflicts.values()):
            steps = np.diff(stream.instants)
            self._steps_back |= bool(np.any((steps < 0) & (steps >= -3600 * SECOND)))
        stream.values.clear()
        stream.rows = None
        time = as_times(series.instants)
        spacing = spacing_of(series.instants)
        for tag in tags:
            value = series.values[tag]
            time.setflags(write=False)
            value.setflags(write=False)
            self._signals[tag] = TagSignal(
                tag=tag, unit=self._units.get(tag, ""), time=time, value=value,
                is_mode=self._is_mode(tag),
            )  # fmt: skip
            self._settled[tag] = series
            self._spacings[tag] = spacing

    def _is_mode(self, tag: str) -> bool:
        if self._plan.assignment.long is None:
            return tag in self._modes
        return self._plan.is_mode_tag(tag)

    def _refuse_midnight(self, stream: Stream) -> None:
        back = np.flatnonzero(np.diff(stream.instants) < 0)
        if back.size:
            line = int(stream.lines_of(back[:1] + 1)[0])
            raise ExportRefused(
                "The time of day runs backwards and there is no date; export the date, too.",
                line=line,
            )

    def _to_utc(self, stream: Stream, tag: str) -> None:
        assert self._zone is not None  # noqa: S101
        converted = to_utc(stream.instants.astype(np.int64, copy=False), self._zone)
        name = self._plan.options.time_zone
        for flags, reason in (
            (converted.missing, f"the clock of {name} jumped over this time in spring"),
            (converted.unclear, f"this time occurred twice in {name} in autumn and the order of "
             "the rows does not tell which is meant"),
        ):  # fmt: skip
            rows = np.flatnonzero(flags)
            if rows.size:
                local = stream.instants[rows[: self._plan.options.max_rejections]]
                texts = [str(stamp) for stamp in local.astype("datetime64[ns]").astype("M8[s]")]
                self._ledger.reject_rows(stream.lines_of(rows), tag, texts.__getitem__, reason)
        stream.instants = converted.instants
        bad = converted.missing | converted.unclear
        if bad.any():
            stream.instants = stream.instants[~bad]
            stream.values = {t: v[~bad] for t, v in stream.values.items()}

    def export(self) -> Export:
        """Find the loops and close the account."""
        columns = {s.column + 1: s.tag for s in self._plan.assignment.signals}
        members, incomplete = find_members(self._signals, columns, self._plan.options)
        if len(members) == 1 and self._plan.options.tag is not None:
            members = [Membership(loop=self._plan.options.tag, tags=members[0].tags)]
        loops = {member.loop: self._loop(member) for member in members}
        noticed = remarks(self._ledger, loops)
        if self.time_zone is None and self._plan.time.is_calendar and self._steps_back:
            noticed += (
                "times step back by an hour and rows of the same local time differ, as when the "
                "clock is set back in autumn; state time_zone=... to keep both",
            )
        decisions = decisions_of(self._plan, noticed)
        return Export(
            decisions=decisions,
            signals=self._signals,
            loops=loops,
            incomplete=incomplete,
            accounting=self._accounting(tuple(self._signals)),
            time_zone=self.time_zone,
        )

    def _loop(self, member: Membership) -> LoopSamples:
        signals = {part: self._signals[tag] for part, tag in member.tags.items()}
        pv = signals[Part.PV]
        values: dict[Part, Values] = {}
        held: list[str] = []
        for part, signal in signals.items():
            values[part], moved = held_on(signal, pv.time)
            if moved:
                held.append(part.value)
        options = self._plan.options
        tags = tuple(member.tags.values())
        return LoopSamples(
            tag=member.loop,
            time=pv.time,
            pv=as_numbers(pv.value),
            op=as_numbers(values[Part.OP]),
            sp=as_numbers(values[Part.SP]) if Part.SP in values else None,
            mode=as_codes(values[Part.MODE]) if Part.MODE in values else None,
            pv_unit=options.pv_unit or pv.unit,
            op_unit=options.op_unit or signals[Part.OP].unit,
            tags={part.value: tag for part, tag in member.tags.items()},
            held=tuple(held),
            accounting=self._accounting(tags, pv.tag),
        )

    def _accounting(self, tags: tuple[str, ...], main: str | None = None) -> Accounting:
        """Close the account of some tags; spacing is that of the main one."""
        ledger = self._ledger
        rows: set[str] = {*ledger.rows_read, *ledger.rows_rejected}
        if main is not None:
            rows = {""} if self._shared else set(tags)
        distinct = self._distinct(tags)
        spacing = self._spacings[main] if main is not None else self._widest()
        words: Counter[str] = Counter()
        for tag in tags:
            words.update(ledger.words.get(tag, {}))
        chosen = {*tags, ""}
        listed = [r for r in ledger.rejections if main is None or r.column in chosen]
        return Accounting(
            rows_read=sum(ledger.rows_read[tag] for tag in rows),
            rows_kept=sum(series.instants.size for series in distinct),
            rows_rejected=sum(ledger.rows_rejected[tag] for tag in rows),
            duplicates=sum(series.duplicates for series in distinct),
            conflicts=sum(s.conflicts.get(tag, 0) for tag in tags for s in [self._settled[tag]]),
            gap_words=dict(words),
            empty_cells=sum(ledger.empty[tag] for tag in tags),
            rejected_cells=sum(ledger.cells_rejected[tag] for tag in tags),
            zeroed_cells=sum(ledger.zeroed[tag] for tag in tags),
            gaps=spacing.gaps,
            longest_gap=spacing.longest_gap,
            sample_time=spacing.sample_time,
            irregular=spacing.irregular,
            span=spacing.span,
            disordered=any(series.disordered for series in distinct),
            rejections=tuple(sorted(listed, key=lambda rejection: rejection.line)),
            reasons=dict(ledger.reasons),
        )

    def _distinct(self, tags: tuple[str, ...]) -> list[Series]:
        return list({id(self._settled[tag]): self._settled[tag] for tag in tags}.values())

    def _widest(self) -> Spacing:
        empty = spacing_of(np.zeros(0))
        return max(self._spacings.values(), key=lambda spacing: spacing.span, default=empty)


def assemble(plan: Plan, streams: Iterable[Stream], ledger: Ledger) -> Export:
    """Put an export together from the streams of a walk.

    Raises
    ------
    ExportRefused
        Where no row is left.
    """
    assembly = Assembly(plan, ledger)
    for stream in streams:
        assembly.add(stream)
    export = assembly.export()
    if export.accounting.rows_kept == 0:
        first = next(iter(export.accounting.rejections), None)
        raise ExportRefused(
            f"No row of samples could be read, the first because {first.reason}."
            if first is not None
            else "The file holds no rows of samples; export it again.",
            line=None if first is None else first.line,
        )
    return export
