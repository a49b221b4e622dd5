"""Which loops oscillate together, and where that comes from: one list of suspects with reasons."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from advice.plantwide_result import (
    Arrow,
    Cascade,
    Delay,
    Graph,
    OscillationGroup,
    PlantOscillations,
    Suspect,
    TransferredInformation,
)
from advice.suspicion import doubts_of, evidence_of, group_reason
from advice.swings import Grid, Swing, swings_of
from advice.transfers import Transfer, doubt_of_entropy, told_by_entropy, transfers_of
from historian.resampling import even_record
from loop.record import Record
from loop.signals import Codes, Flags, Real
from monitoring.cascade_pairs import CascadePair, cascade_pairs
from monitoring.loop_signals import bridged

# A gap of so many samples is bridged, as in an assessment; a loop with longer ones is left out.
LARGEST_GAP = 3.5
FEWEST_SAMPLES = 64
# Of a grid with more points than so many times the samples, nearly all would be invented.
MOST_POINTS = 20


def plant_oscillations(
    records: Sequence[Record], *, levels: Collection[str] = (), seed: int = 0
) -> PlantOscillations:
    """Group loops that oscillate together and rank where it comes from.

    Parameters
    ----------
    records : sequence of Record
        Routine data of several loops over the same period, each with its tag and start.
    levels : collection of str
        Tags of the loops whose process integrates; valves are judged by other shapes there.
    seed : int
        Seed of surrogates and shifts.

    Raises
    ------
    ValueError
        Two records share a tag, one has no start, or a level is none of them.
    """
    tags = [record.tag for record in records]
    if len({*tags}) != len(tags):
        raise ValueError("every loop may be given once")
    unknown = {*levels} - {*tags}
    if unknown:
        raise ValueError(f"{', '.join(sorted(unknown))} is none of the loops")
    # By name, so that the order in which loops are given changes no digit of the answer.
    records = sorted(records, key=lambda record: record.tag)
    unfit = {record.tag: _unfit(record) for record in records}
    usable = [record for record in records if not unfit[record.tag]]
    left_out = [(tag, reason) for tag, reason in unfit.items() if reason]
    together = _together(usable)
    if together is None:
        left_out += [(record.tag, "no time in common with the others") for record in usable]
        return PlantOscillations(groups=(), cascades=(), left_out=tuple(left_out))
    dt, grids = together
    error = np.array([grid.sp - grid.pv for grid in grids])
    whole = _whole(error)
    left_out += [
        (record.tag, "no set point, or gaps that are too long")
        for record, good in zip(usable, whole, strict=True)
        if not good
    ]
    kept = [record.tag for record, good in zip(usable, whole, strict=True) if good]
    cascades = cascade_pairs(
        np.array([grid.op for grid in grids]), np.array([grid.sp for grid in grids])
    )
    return PlantOscillations(
        groups=_groups(
            [grid for grid, good in zip(grids, whole, strict=True) if good], dt, kept, levels, seed
        ),
        cascades=tuple(_cascade(pair, [record.tag for record in usable]) for pair in cascades),
        left_out=tuple(left_out),
    )


def _unfit(record: Record) -> str:
    """Say why a loop cannot be put on a grid; empty where it can."""
    if len(record) < FEWEST_SAMPLES:
        return f"{len(record)} samples are fewer than {FEWEST_SAMPLES}"
    if record.span / record.sample_time > MOST_POINTS * len(record):
        return "samples far too uneven"
    return ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Row:
    """One loop on the common grid, NaN where unknown."""

    pv: Real
    op: Real
    sp: Real
    mode: Codes | None


def _together(records: Sequence[Record]) -> tuple[float, list[_Row]] | None:
    """Put the loops on one grid over the time that all of them cover."""
    if len(records) < 2:
        return None
    if any(record.start is None for record in records):
        raise ValueError("loops are compared by the clock: every record needs its start")
    begin = [record.start.timestamp() for record in records if record.start is not None]
    dt = max(record.sample_time for record in records)
    start = max(begin)
    end = min(b + float(record.t[-1]) for b, record in zip(begin, records, strict=True))
    grid = np.arange(0.0, end - start, dt)
    if grid.size < FEWEST_SAMPLES:
        return None
    rows = []
    for b, record in zip(begin, records, strict=True):
        even = even_record(record, dt, max_gap=LARGEST_GAP * dt)
        # The nearest sample of the even grid: half a sample of shift at most.
        place = np.clip(np.round((grid + start - b - even.t[0]) / dt), 0, len(even) - 1)
        at = place.astype(np.int64)
        rows.append(
            _Row(
                pv=even.pv[at],
                op=even.op[at],
                sp=np.full(grid.size, np.nan) if even.sp is None else even.sp[at],
                mode=None if even.mode is None else even.mode[at],
            )
        )
    return dt, rows


def _whole(error: Real) -> Flags:
    """Tell which errors are known for at least nine tenths of the time."""
    return np.asarray(np.mean(np.isfinite(error), axis=1) >= 0.9)


def _groups(
    rows: Sequence[_Row], dt: float, tags: Sequence[str], levels: Collection[str], seed: int
) -> tuple[OscillationGroup, ...]:
    if len(rows) < 2:
        return ()
    grid = Grid(
        dt=dt,
        error=np.array([bridged(row.sp - row.pv) for row in rows]),
        pv=np.array([bridged(row.pv) for row in rows]),
        op=np.array([row.op for row in rows]),
        mode=tuple(row.mode for row in rows),
        levels=tuple(tag in levels for tag in tags),
    )
    return tuple(
        _group(swing, [tags[member] for member in swing.members], dt, seed)
        for swing in swings_of(grid, seed=seed)
    )


def _group(swing: Swing, tags: Sequence[str], dt: float, seed: int) -> OscillationGroup:
    named = swing.origin.named
    transfers = transfers_of(swing, seed=seed)
    order = np.argsort(-np.array(swing.origin.probabilities), kind="stable").tolist()
    compared = [tags[k] for k in swing.compared]
    arrows = tuple(
        Arrow(
            cause=compared[one.cause], effect=compared[one.effect], strength=one.strength,
            p_value=one.p_value, beyond=one.beyond, significant=one.significant,
        )
        for one in swing.arrows.arrows
    )  # fmt: skip
    delays = tuple(
        Delay(
            first=compared[one.first], second=compared[one.second], delay=one.delay * dt,
            error=one.error * dt, sign=one.sign, correlation=one.correlation,
            rival=one.rival * dt, clear=one.clear,
            phase_delay=None if one.phase_delay is None else one.phase_delay * dt,
        )
        for one in swing.delays
    )  # fmt: skip
    return OscillationGroup(
        period=swing.period * dt,
        similarity=swing.similarity,
        source=None if named is None else tags[named],
        elsewhere=swing.origin.elsewhere,
        reason=group_reason(swing, tags),
        suspects=tuple(_suspect(swing, transfers, place, tags, dt) for place in order),
        arrows=arrows,
        order=swing.arrows.order,
        delays=delays,
        graph=_graph([tags[place] for place in order], arrows, delays),
        transfers=tuple(_transfer(one, tags, dt) for one in transfers),
        doubts=tuple(said for said in (*doubts_of(swing), doubt_of_entropy(transfers)) if said),
    )


def _transfer(one: Transfer, tags: Sequence[str], dt: float) -> TransferredInformation:
    return TransferredInformation(
        cause=tags[one.cause], effect=tags[one.effect], value=one.found.value,
        by_chance=one.found.by_chance, p_value=one.found.p_value, beyond=one.found.beyond,
        significant=one.found.significant, delay=None if one.delay is None else one.delay * dt,
    )  # fmt: skip


def _suspect(
    swing: Swing, transfers: Sequence[Transfer], place: int, tags: Sequence[str], dt: float
) -> Suspect:
    entropy = told_by_entropy(transfers, place, tags, dt)
    evidence = (*evidence_of(swing, place, tags, dt), *([entropy] if entropy else []))
    return Suspect(
        tag=tags[place],
        probability=swing.origin.probabilities[place],
        nonlinearity=swing.loops[place].nonlinearity,
        stiction=swing.loops[place].stiction,
        coherence=swing.coherence[place],
        share=swing.loops[place].share,
        oscillates=swing.own[place],
        evidence=evidence,
        reason="; ".join(evidence),
    )


def _graph(tags: Sequence[str], arrows: Sequence[Arrow], delays: Sequence[Delay]) -> Graph:
    strength = {(one.cause, one.effect): one.strength for one in arrows if one.significant}
    delay = {(one.first, one.second): one.delay for one in delays if one.clear}
    delay |= {(second, first): -value for (first, second), value in delay.items()}
    return Graph(
        tags=tuple(tags),
        strength=tuple(tuple(strength.get((row, column)) for column in tags) for row in tags),
        delay=tuple(tuple(delay.get((row, column)) for column in tags) for row in tags),
    )


def _cascade(pair: CascadePair, tags: Sequence[str]) -> Cascade:
    return Cascade(outer=tags[pair.outer], inner=tags[pair.inner], explained=pair.explained)
