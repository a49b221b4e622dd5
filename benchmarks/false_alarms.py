"""False alarms and detection of oscillation and stiction on simulated loops, and real episodes.

    python -m benchmarks.false_alarms

Limits and weights were fixed before these seeds were drawn.
"""

import csv
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

from benchmarks.section import Section, Target
from benchmarks.virtual_loops import State, VirtualLoop, virtual_loops
from loop.signals import Real
from monitoring.loop_signals import Stretch
from monitoring.oscillation import oscillation
from monitoring.stiction import stiction
from monitoring.stiction_result import Stiction, StictionVerdict

SEED = 930
SAMPLES = 2000
EPISODES = Path(__file__).parent.parent.parent / "shared" / "data" / "refinery_loops"
# The probability is calibrated with sticking and other loops equally likely beforehand: a refusal
# leaves just that.
PRIOR = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What was said of one simulated loop.

    Attributes
    ----------
    oscillates : bool
        An oscillation was found; for a driven loop, that of the driving wave or its valve.
    verdict : StictionVerdict
        Word on the valve.
    probability : float
        Probability of stiction, 0 where there was nothing to judge. [-]
    S : float
        True stiction band. [%]
    """

    oscillates: bool
    verdict: StictionVerdict
    probability: float
    S: float


def judged(one: VirtualLoop) -> Outcome:
    """Judge one simulated loop as the product does."""
    error = one.sp - one.pv
    swings = oscillation(error, 1.0)
    stretch = Stretch(first=0, dt=1.0, pv=one.pv, op=one.op, sp=one.sp, share=1.0)
    found: Stiction = stiction(stretch, swings, integrating=one.integrating)
    return Outcome(
        oscillates=swings.oscillates,
        verdict=found.verdict,
        probability=found.probability or 0.0,
        S=one.S,
    )


def outcomes(state: State, count: int, *, seed: int = SEED) -> list[Outcome]:
    """Judge simulated loops of one state; sticking ones are those that drive a cycle."""
    loops = virtual_loops(state, count, samples=SAMPLES, seed=seed)
    return [judged(one) for one in loops if state is not State.STICKING or one.drives]


def sine_detection(count: int, *, seed: int = SEED) -> float:
    """Part of sines found whose amplitude is the sd of a healthy loop's error, by their period."""
    rng = np.random.default_rng(seed + 1)
    hits = []
    for one in virtual_loops(State.HEALTHY, count, samples=SAMPLES, seed=seed + 1):
        error = one.sp - one.pv
        period = float(np.exp(rng.uniform(np.log(8), np.log(SAMPLES / 10))))
        angle = 2 * np.pi * np.arange(SAMPLES) / period + rng.uniform(0, 2 * np.pi)
        found = oscillation(error + float(np.std(error)) * np.sin(angle), 1.0)
        hits.append(any(abs(c.period / period - 1) < 0.05 for c in found.components))
    return float(np.mean(hits))


def episode_probabilities(folder: Path = EPISODES) -> dict[str, tuple[int, float, float, bool]]:
    """Expert's label, our mean probability, the plant's mean index, whether we refused them all."""
    found: dict[str, list[tuple[int, float, float, bool]]] = defaultdict(list)
    with (folder / "episodes.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            signals = episode_signals(folder / row["file"])
            dt = float(row["sample_time_s"])
            stretch = Stretch(
                first=0, dt=dt, pv=signals[:, 1], op=signals[:, 0], sp=signals[:, 2], share=1.0
            )
            said = stiction(
                stretch, oscillation(stretch.error, dt), integrating="LIC" in row["loop"]
            )
            found[row["loop"]].append(
                (
                    int(row["stiction"]),
                    PRIOR if said.probability is None else said.probability,
                    float(row["plant_index"]),
                    said.probability is None,
                )
            )
    return {
        loop: (
            rows[0][0],
            float(np.mean([r[1] for r in rows])),
            float(np.mean([r[2] for r in rows])),
            all(r[3] for r in rows),
        )
        for loop, rows in found.items()
    }


def first_episode(loop: str, folder: Path = EPISODES) -> tuple[Path, float]:
    """File of a loop's first episode, and its sample time. [s]"""
    with (folder / "episodes.csv").open(encoding="utf-8") as file:
        row = next(row for row in csv.DictReader(file) if row["loop"] == loop)
    return folder / row["file"], float(row["sample_time_s"])


def episode_signals(path: Path) -> Real:
    """OP, PV and SP of an episode: rows of numbers behind the head."""
    rows = []
    for line in path.read_text("utf-8", errors="replace").splitlines():
        cells = line.split("\t")
        try:
            rows.append([float(cell) for cell in cells[1:4]])
        except ValueError:
            continue
    return np.array([row for row in rows if len(row) == 3])


def auc(label: Real, score: Real) -> float:
    """Area under the ROC: part of the pairs won, ties half."""
    ranks = rankdata(score)
    ones = int(np.sum(label))
    zeros = label.size - ones
    return float((np.sum(ranks[label == 1]) - ones * (ones + 1) / 2) / (ones * zeros))


def auc_interval(
    label: Real, score: Real, *, draws: int = 2000, seed: int = 0
) -> tuple[float, float]:
    """95 % bootstrap interval, loops drawn within each label."""
    rng = np.random.default_rng(seed)
    ones, zeros = score[label == 1], score[label == 0]
    found = [
        auc(
            np.r_[np.ones(ones.size), np.zeros(zeros.size)],
            np.r_[rng.choice(ones, ones.size), rng.choice(zeros, zeros.size)],
        )
        for _ in range(draws)
    ]
    low, high = np.quantile(found, [0.025, 0.975])
    return float(low), float(high)


def measure(*, healthy: int = 1000, others: int = 300) -> Section:
    """Judge simulated loops of every state, and the episodes where they are at hand."""
    counts = dict.fromkeys(State, others) | {State.HEALTHY: healthy, State.STICKING: 600}
    with ProcessPoolExecutor(2) as pool:
        jobs = {state: pool.submit(outcomes, state, count) for state, count in counts.items()}
        sines = pool.submit(sine_detection, others)
        found = {state: job.result() for state, job in jobs.items()}
        sine = sines.result()
    rows = [_row(state, found[state]) for state in State]
    shares = {state: _shares(found[state]) for state in State}
    targets = [
        Target(what="healthy loops called oscillating", limit=1.0, unit="%",
               reached=100 * shares[State.HEALTHY][0]),
        Target(what="healthy loops called sticking", limit=1.0, unit="%",
               reached=100 * shares[State.HEALTHY][1]),
        Target(what="healthy loops undecided", limit=20.0, unit="%",
               reached=100 * shares[State.HEALTHY][2]),
        Target(what="sticking loops called sticking", limit=95.0, unit="%", at_least=True,
               reached=100 * shares[State.STICKING][1]),
        Target(what="sticking loops undecided", limit=20.0, unit="%",
               reached=100 * shares[State.STICKING][2]),
        Target(what="sines as large as the sd of the error found", limit=95.0, unit="%",
               at_least=True, reached=100 * sine),
    ]  # fmt: skip
    notes = [_reliability(found), _by_size(found[State.STICKING])]
    if EPISODES.is_dir():
        target, note = _episodes()
        targets.append(target)
        notes.append(note)
    return Section(
        title="Oscillation and stiction: false alarms and detection",
        how=(
            f"{SAMPLES} samples a loop, seed {SEED}, which neither weights nor limits have seen. "
            "Healthy: white to .97 autocorrelated disturbances, set-point moves, loads, levels. "
            "Sticking: S 1 to 10 % of OP, J .1 to 1 S, three valve models, only loops whose "
            "cycle goes on without noise. Undecided counts as a miss."
        ),
        columns=("state", "loops", "oscillating", "sticking", "undecided"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=tuple(notes),
    )


def run() -> Section:
    """Measure with the numbers of loops that the targets speak of."""
    return measure()


def _shares(found: list[Outcome]) -> tuple[float, float, float]:
    verdicts = [one.verdict for one in found]
    return (
        float(np.mean([one.oscillates for one in found])),
        float(np.mean([v is StictionVerdict.STICTION for v in verdicts])),
        float(np.mean([v is StictionVerdict.UNDECIDED for v in verdicts])),
    )


def _row(state: State, found: list[Outcome]) -> tuple[str, ...]:
    swings, sticks, undecided = _shares(found)
    return (
        state.value, str(len(found)), f"{100 * swings:.1f} %", f"{100 * sticks:.1f} %",
        f"{100 * undecided:.1f} %",
    )  # fmt: skip


def _reliability(found: dict[State, list[Outcome]]) -> str:
    """Stated against true share of sticking loops, both classes weighed alike."""
    p = np.array([one.probability for rows in found.values() for one in rows])
    y = np.array([state is State.STICKING for state, rows in found.items() for _ in rows])
    weight = np.where(y, 0.5 / np.mean(y), 0.5 / np.mean(~y))
    parts = []
    for low, high in ((0.0, 0.2), (0.2, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 1.01)):
        inside = (p >= low) & (p < high)
        if np.any(inside):
            truth = float(np.sum(weight[inside] * y[inside]) / np.sum(weight[inside]))
            stated = float(np.average(p[inside], weights=weight[inside]))
            parts.append(
                f"{stated:.2f} stated, {truth:.2f} true ({np.count_nonzero(inside)} loops)"
            )
    return "Reliability: " + "; ".join(parts) + "."


def _by_size(found: list[Outcome]) -> str:
    parts = []
    for low, high in ((1, 2), (2, 4), (4, 10)):
        said = [one.verdict is StictionVerdict.STICTION for one in found if low <= one.S < high]
        parts.append(f"S {low} to {high} %: {100 * np.mean(said):.0f} % of {len(said)}")
    return "Detection by size: " + "; ".join(parts) + "."


def _episodes() -> tuple[Target, str]:
    loops = episode_probabilities()
    label = np.array([row[0] for row in loops.values()])
    ours = np.array([row[1] for row in loops.values()])
    plant = np.array([row[2] for row in loops.values()])
    pairs = int(label.sum() * (label.size - label.sum()))
    value = auc(label, ours)
    low, high = auc_interval(label, ours)
    none = np.array([row[3] for row in loops.values()])
    refused = int(np.count_nonzero(none))
    order = sorted(loops.items(), key=lambda item: -item[1][1])
    listed = ", ".join(
        f"{loop} {row[1]:.2f}" + (" (sticky)" if row[0] else "") for loop, row in order[:8]
    )
    return (
        Target(what="refinery episodes by loop, AUC", limit=0.95, reached=value, unit="",
               at_least=True),
        f"Refinery episodes by loop: {value * pairs:g} of {pairs} pairs won, AUC {value:.3f}, "
        f"bootstrap {low:.3f} to {high:.3f}; the plant's own index {auc(label, plant):.3f} on the "
        f"same loops. They chose nothing here. {refused} of the {label.size} loops are refused "
        f"throughout and count one half; with 0 for them the AUC is "
        f"{auc(label, np.where(none, 0.0, ours)):.3f}. "
        f"Highest mean probabilities: {listed}.",
    )  # fmt: skip


if __name__ == "__main__":
    from benchmarks.section import as_markdown

    print(as_markdown(run()))
