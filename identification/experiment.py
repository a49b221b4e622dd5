"""What a record holds for identification: samples in manual, the moves of the output, the gaps."""

from dataclasses import dataclass

import numpy as np

from identification.frequency_test import looks_like_frequency_test
from identification.held_input import HeldInput, Indices
from identification.steps import Step, find_moves
from loop.errors import FitNotTrusted, PoorExcitation
from loop.record import Mode, Record
from loop.signals import Flags, Real

# Four to six parameters and some freedom to see whether they fit.
FEWEST_SAMPLES = 12
# Far beyond any range of a transmitter, and any step test.
LARGEST, SHORTEST = 1e12, 1e-6
# More moves than this are averaged: their answers overlap, and a fit takes time for each.
MOST_MOVES = 2000
# A controller's law explains nearly all of what its output does; a person or a program in open
# loop, next to nothing.
FOLLOWS, FEWEST_MOVES = 0.8, 30


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiment:
    """Samples and moves that a model can be fitted to.

    Attributes
    ----------
    t, pv, op : ndarray, shape (n,)
        Samples that have all three, from the record's longest stretch in manual.
        [s], [PV], [OP]
    held : HeldInput
        The output as a held input.
    steps : tuple of Step
        Its moves.
    exact : bool
        Whether `held` has every change of the output; noise and very many moves are averaged.
    waves : bool
        Whether the record is a frequency test: waves, which are held nowhere.
    stated_before : bool
        Whether the first move comes from the output that the user states for the time before the
        first sample.
    notes : tuple of str
        What was left out or averaged, in words.
    """

    t: Real
    pv: Real
    op: Real
    held: HeldInput
    steps: tuple[Step, ...]
    exact: bool
    waves: bool
    stated_before: bool
    notes: tuple[str, ...]

    @property
    def spacing(self) -> float:
        """Median time between samples. [s]"""
        return float(np.median(np.diff(self.t)))

    def hole_before(self, step: Step) -> float:
        """Time from the sample before a move to the one that shows it, 0 at the start. [s]"""
        return float(self.t[step.first] - self.t[max(step.first - 1, 0)])


def read_experiment(record: Record) -> Experiment:
    """Take from a record what identification in open loop can use.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.

    Raises
    ------
    PoorExcitation
        There are too few samples, or PV stands still.
    FitNotTrusted
        The controller was in automatic, by its mode or by what its output does.
    NoStepFound
        The output does not move.
    """
    notes: list[str] = []
    known = np.isfinite(record.pv) & np.isfinite(record.op)
    _require_samples(int(np.count_nonzero(known)), "have both PV and OP")
    if not np.all(known):
        notes.append(
            f"{np.count_nonzero(~known)} of {len(record)} rows lack PV or OP and are left out"
        )
    used = known & _manual(record, known, notes)
    _require_samples(int(np.count_nonzero(used)), "in manual have both PV and OP")
    t, pv, op = record.t[used], record.pv[used], record.op[used]
    _require_sane(t, pv, op)
    op_before = record.op_before if used[np.flatnonzero(known)[0]] else None

    moves = find_moves(t, op, op_before)
    if np.ptp(pv) == 0:
        raise PoorExcitation(
            f"Nothing moved in PV: it stands at {pv[0]:.4g} throughout, while OP moved by "
            f"{moves.steps[0].size:+.4g}."
        )
    _require_open_loop(t, pv, op, None if record.sp is None else record.sp[used])
    stated = moves.steps[0].first == 0
    waves = looks_like_frequency_test(record)
    # What moves in every sample by design is no noise.
    noise = 0.0 if waves else moves.noise_sd
    held = _held(t, op, moves.anchors, noise, op_before if stated else None, notes)
    return Experiment(
        t=t, pv=pv, op=op, held=held, steps=moves.steps, waves=waves,
        exact=noise == 0 and held.moves < MOST_MOVES, stated_before=stated, notes=tuple(notes),
    )  # fmt: skip


def _require_samples(count: int, which: str) -> None:
    if count < FEWEST_SAMPLES:
        raise PoorExcitation(
            f"Only {count} samples {which}; a model with its errors needs at least "
            f"{FEWEST_SAMPLES}."
        )


def _require_sane(t: Real, pv: Real, op: Real) -> None:
    """Keep sums of squares within what arithmetic holds."""
    largest = max(float(np.max(np.abs(pv))), float(np.max(np.abs(op))))
    if largest > LARGEST:
        raise PoorExcitation(
            f"PV or OP reaches {largest:.3g}, which no measurement does; mark such readings as bad."
        )
    if t[-1] - t[0] < SHORTEST:
        raise PoorExcitation(f"The record spans only {t[-1] - t[0]:.3g} s.")


def _manual(record: Record, known: Flags, notes: list[str]) -> Flags:
    """Rows of the stretch in manual over which the output moved most.

    A mode that is not known does not speak against manual.
    """
    if record.mode is None:
        return np.ones(len(record), dtype=np.bool_)
    automatic = np.isin(record.mode, (Mode.AUTO, Mode.CAS, Mode.REMOTE))
    if not np.any(automatic & known):
        return np.ones(len(record), dtype=np.bool_)
    edges = np.flatnonzero(np.diff(automatic.astype(int), prepend=1, append=1))
    stretches = [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    travelled = [_range(record.op[s]) for s in stretches]
    if not any(travelled):
        raise FitNotTrusted(
            f"The controller was in automatic in {np.count_nonzero(automatic)} of {len(record)} "
            "rows and OP did not move in manual: in a closed loop OP answers PV, and this method "
            "takes OP for the cause. Make a step in manual."
        )
    best = stretches[int(np.argmax(travelled))]
    chosen = np.zeros(len(record), dtype=np.bool_)
    chosen[best] = True
    notes.append(
        f"{np.count_nonzero(chosen)} of {len(record)} rows are used, those in manual from "
        f"{record.t[best.start]:.4g} s to {record.t[best.stop - 1]:.4g} s"
    )
    return chosen


def _range(op: Real) -> float:
    good = op[np.isfinite(op)]
    return float(np.ptp(good)) if good.size else 0.0


def _require_open_loop(t: Real, pv: Real, op: Real, sp: Real | None) -> None:
    """Refuse an output that follows PV by a controller's law, where no mode says so."""
    moved = np.diff(op)
    count = int(np.count_nonzero(moved))
    if count < max(FEWEST_MOVES, op.size // 5):
        return
    # The change of a PID output is linear in the last three errors.
    columns = [np.ones(op.size - 3), pv[3:], pv[2:-1], pv[1:-2]]
    if sp is not None and np.all(np.isfinite(sp)):
        columns += [sp[3:], sp[2:-1]]
    design, answer = np.stack(columns, axis=1), moved[2:]
    best, *_ = np.linalg.lstsq(design, answer, rcond=None)
    left = float(np.var(answer - design @ best))
    explained = 1 - left / max(float(np.var(answer)), 1e-300)
    if explained > FOLLOWS:
        raise FitNotTrusted(
            f"OP follows PV like a controller's output: the last three PVs explain "
            f"{explained:.0%} of what it does over {t[-1] - t[0]:.4g} s. In a closed loop OP "
            "answers PV, and this method takes OP for the cause. Make a step in manual."
        )


def _held(
    t: Real,
    op: Real,
    anchors: Indices,
    noise_sd: float,
    op_before: float | None,
    notes: list[str],
) -> HeldInput:
    changes = int(np.count_nonzero(np.diff(op)))
    if noise_sd == 0 and changes <= MOST_MOVES:
        return HeldInput.from_samples(t, op, op_before)
    if anchors.size <= MOST_MOVES:
        notes.append(
            f"OP is averaged over its {anchors.size} holds, about which it jitters by "
            f"{noise_sd:.3g}"
        )
        return HeldInput.from_holds(t, op, anchors, op_before)
    notes.append(f"OP moves {changes} times and is averaged over {MOST_MOVES} equal stretches")
    edges = np.linspace(0, t.size, MOST_MOVES, endpoint=False).astype(np.intp)
    return HeldInput.from_holds(t, op, edges, op_before)
