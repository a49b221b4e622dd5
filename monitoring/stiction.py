"""Does the valve stick? All methods together, as one calibrated probability."""

import numpy as np

from monitoring.answer_model import answer_model, joint_vector
from monitoring.basis import Basis, Confidence, Setting, refusal
from monitoring.loop_signals import Stretch
from monitoring.op_pv_figure import apparent_stiction
from monitoring.oscillation import Oscillation
from monitoring.stiction_features import StictionFeatures, active_part
from monitoring.stiction_result import Stiction, StictionEvidence, StictionVerdict
from monitoring.stiction_search import CLEAR, StictionSearch
from monitoring.valve_answers import FEWEST_SAMPLES, LEAST_MOVE, ValveAnswers, valve_answers
from monitoring.wave_shapes import area_ratio, hagglund_index, he_index, rossi_scali_index
from monitoring.wave_word import wave_word

# Of measurements that stand wholly still while OP moves, two in three are taken as a valve that
# does not move, one as a measurement that is frozen: valves fail more often. No data say it. OP
# that moved by less than this part of its range shows nothing.
STILL_PRIOR, STILL_MOVE = 2 / 3, 0.01
NOTHING_KNOWN = 0.5


def stiction(
    stretch: Stretch,
    swings: Oscillation,
    *,
    op_span: float = 100.0,
    integrating: bool = False,
    compressed: bool = False,
) -> Stiction:
    """Judge the valve from PV's answers to OP, and from the waves of both where they swing.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    swings : Oscillation
        Oscillations of its error.
    op_span : float
        Range of the output. [OP]
    integrating : bool
        Whether the process integrates.
    compressed : bool
        Whether the historian compressed PV beyond what wave shapes bear.
    """
    if not np.ptp(stretch.op) > 0:
        return _nothing_to_judge(stretch, "OP does not move")
    if not np.ptp(stretch.pv) > 0:
        return _still(stretch, op_span)
    period = None if swings.main is None else swings.main.period / stretch.dt
    answers = valve_answers(
        stretch.op, stretch.pv, stretch.error, op_span=op_span, integrating=integrating,
        period=period,
    )  # fmt: skip
    if answers is None:
        return _nothing_to_judge(stretch, f"fewer than {FEWEST_SAMPLES} samples")
    word, found, search = wave_word(
        stretch.op, stretch.pv, stretch.error, swings, stretch.dt, op_span=op_span,
        integrating=integrating,
    )  # fmt: skip
    model = answer_model()
    alone = float(model.answers(answers.vector[None])[0])
    probability = float(model.together(joint_vector(alone, word)[None])[0])
    verdict = StictionVerdict.UNDECIDED
    if probability >= model.stiction_from and answers.op_range >= LEAST_MOVE:
        verdict = StictionVerdict.STICTION
    elif probability < model.none_below:
        verdict = StictionVerdict.NONE
    size = None
    if found is not None:
        part = active_part(swings, stretch.dt)
        size = apparent_stiction(stretch.op[part], stretch.pv[part], found.period)
    waves = () if found is None else (*_evidence(found, integrating), _searched(search))
    return Stiction(
        verdict=verdict,
        probability=probability,
        evidence=(*_answered(answers), *waves),
        S=None if search is None or search.S is None else 100 * search.S / op_span,
        J=None if search is None or search.J is None else 100 * search.J / op_span,
        apparent_size=None if size is None else 100 * size / op_span,
        basis=_basis(stretch, swings, answers, found, verdict, compressed),
    )


def _nothing_to_judge(stretch: Stretch, why: str) -> Stiction:
    return Stiction(
        verdict=StictionVerdict.UNDECIDED,
        probability=None,
        evidence=(),
        S=None,
        J=None,
        apparent_size=None,
        basis=refusal(why, share=stretch.share),
    )


def _still(stretch: Stretch, op_span: float) -> Stiction:
    """PV keeps one value while OP moves: a valve that does not move, or a frozen measurement."""
    moved = float(np.ptp(stretch.op)) / op_span
    enough = moved >= STILL_MOVE
    note = f"PV kept one value while OP moved by {100 * moved:.2g} % of its range"
    return Stiction(
        verdict=StictionVerdict.UNDECIDED,
        probability=STILL_PRIOR if enough else NOTHING_KNOWN,
        evidence=(
            StictionEvidence(
                method="PV still while OP moves", value=1.0, note=note,
                verdict=StictionVerdict.STICTION if enough else StictionVerdict.UNDECIDED,
            ),
        ),
        S=None,
        J=None,
        apparent_size=None,
        basis=Basis(
            share=stretch.share,
            confidence=Confidence.LOW,
            reasons=(
                note,
                "a valve that does not move and a frozen measurement look alike here; "
                "two to one for the valve is an assumption",
            ),
        ),
    )  # fmt: skip


def _basis(
    stretch: Stretch,
    swings: Oscillation,
    answers: ValveAnswers,
    found: StictionFeatures | None,
    verdict: StictionVerdict,
    compressed: bool,
) -> Basis:
    doubts = []
    if found is None or not swings.oscillates:
        doubts.append("there is no clear oscillation whose wave could be judged")
    if compressed:
        doubts.append("PV was compressed, which straightens waves")
    if found is not None and swings.oscillates:
        if found.period < 12:
            doubts.append(f"a cycle has only {found.period:.0f} samples")
        if found.cycle.cycles < 6:
            doubts.append(f"only {found.cycle.cycles} cycles are alike")
    if answers.op_range < LEAST_MOVE:
        doubts.append(
            f"OP moved by only {100 * answers.op_range:.2g} % of its range: a sound valve's own "
            "dead band may hold it"
        )
    if verdict is StictionVerdict.UNDECIDED:
        doubts.append("the probability lies between the two limits")
    model = answer_model()
    settings: tuple[Setting, ...] = (
        ("block, s", answers.block * stretch.dt),
        ("half swing of OP, s", answers.half_swing * stretch.dt),
        ("stiction from", model.stiction_from),
        ("none below", model.none_below),
        ("fitted on", "simulated windows and loops alone"),
    )
    if found is not None:
        settings = (
            ("period, s", found.period * stretch.dt),
            ("cycles", float(found.cycle.cycles)),
            *settings,
        )
    grades = (Confidence.HIGH, Confidence.MEDIUM, Confidence.LOW)
    return Basis(
        share=stretch.share,
        confidence=grades[min(len(doubts), 2)],
        reasons=tuple(doubts),
        settings=settings,
    )


def _answered(answers: ValveAnswers) -> tuple[StictionEvidence, ...]:
    """What PV's answers say alone; each convicts or acquits only beyond rare values."""
    model = answer_model()
    lost = answers.lost_motion >= model.lost_motion_from
    answered = answers.correlation >= model.correlation_from
    return (
        StictionEvidence(
            method="lost motion", value=answers.lost_motion,
            verdict=StictionVerdict.STICTION if lost else StictionVerdict.UNDECIDED,
            note=f"{_dead_band(answers.width)}; one sound loop of a hundred is beyond "
            f"{model.lost_motion_from:.3g} (blocks times the log of the ratio of the residuals)",
        ),
        StictionEvidence(
            method="correlation of OP and PV", value=answers.correlation,
            verdict=StictionVerdict.NONE if answered else StictionVerdict.UNDECIDED,
            note=f"at the best lag; one sticking valve of a hundred is beyond "
            f"{model.correlation_from:.3g}, and low values prove nothing",
        ),
        StictionEvidence(
            method="unanswered travel", value=answers.unanswered,
            verdict=StictionVerdict.UNDECIDED,
            note="part of OP's travel during which the error stayed; loads can do that too",
        ),
    )  # fmt: skip


def _dead_band(width: float) -> str:
    if width == 0:
        return "no dead band explains PV better than none"
    return f"a dead band of {width:.0%} of OP's range in the window explains PV best"


def _evidence(found: StictionFeatures, integrating: bool) -> tuple[StictionEvidence, ...]:
    """Every method's own word, by its published limits."""
    cycle = found.cycle
    he = he_index(cycle.pv if integrating else cycle.op)
    relay = rossi_scali_index(cycle.pv)
    square = hagglund_index(cycle.pv)
    ratio = area_ratio(cycle.pv)
    return (
        _horch(found, integrating),
        StictionEvidence(
            method="curve fitting (He)", value=he, verdict=_between(he, 0.4, 0.6),
            note="E_sine/(E_sine + E_triangle) of " + ("PV" if integrating else "OP"),
        ),
        StictionEvidence(
            method="relay fitting (Rossi-Scali)", value=relay,
            verdict=_between(relay, -0.21, 0.21), note="(E_sine - E_RT)/(E_sine + E_RT) of PV",
        ),
        StictionEvidence(
            method="square fitting (Hägglund)", value=square, verdict=_between(square, 0.0, 0.0),
            note="(V_sine - V_square)/(V_sine + V_square) of PV",
        ),
        StictionEvidence(
            method="area ratio (Singhal-Salsbury)", value=ratio,
            verdict=_between(ratio, 1.05, 1.3), note="area before over area after the peak of PV",
        ),
        _nonlinear(found),
    )  # fmt: skip


def _searched(search: StictionSearch | None) -> StictionEvidence:
    method = "search for S and J (Hammerstein)"
    if search is None or search.improvement is None:
        why = "not flagged, so not searched" if search is None else search.basis.reasons[0]
        return StictionEvidence(
            method=method, value=None, verdict=StictionVerdict.UNDECIDED, note=why
        )
    found = search.improvement > 2 * CLEAR
    return StictionEvidence(
        method=method,
        value=search.improvement,
        verdict=StictionVerdict.STICTION if found else StictionVerdict.NONE,
        note="part of the linear model's residual that a sticking valve takes off",
    )


def _between(value: float, none: float, some: float) -> StictionVerdict:
    if value > some:
        return StictionVerdict.STICTION
    return StictionVerdict.NONE if value <= none else StictionVerdict.UNDECIDED


def _horch(found: StictionFeatures, integrating: bool) -> StictionEvidence:
    method = "cross-correlation (Horch)"
    seen = found.correlation
    if integrating or seen is None:
        why = "for self-regulating processes only" if integrating else "it does not cross zero"
        return StictionEvidence(
            method=method, value=None, verdict=StictionVerdict.UNDECIDED, note=why
        )
    verdict = StictionVerdict.UNDECIDED
    if seen.odd or seen.even:
        verdict = StictionVerdict.STICTION if seen.odd else StictionVerdict.NONE
    return StictionEvidence(
        method=method,
        value=seen.delta_tau,
        verdict=verdict,
        note=f"delta tau; delta rho {seen.delta_rho:.2f}; odd beyond 2/3, even below 1/3",
    )


def _nonlinear(found: StictionFeatures) -> StictionEvidence:
    method = "bicoherence (Choudhury)"
    seen = found.bicoherence
    if seen is None:
        return StictionEvidence(
            method=method, value=None, verdict=StictionVerdict.UNDECIDED, note="too few samples"
        )
    note = "NLI, after NGI fired" if seen.NLI is not None else "NGI; it did not fire"
    return StictionEvidence(
        method=method,
        value=seen.NLI if seen.NLI is not None else seen.NGI,
        # Blind to symmetric cycles, so that silence proves nothing.
        verdict=StictionVerdict.STICTION if seen.nonlinear else StictionVerdict.UNDECIDED,
        note=note,
    )
