"""Does the valve stick? All methods together, as one calibrated probability."""

import numpy as np

from monitoring.basis import Basis, Confidence, Setting, refusal
from monitoring.loop_signals import Stretch
from monitoring.op_pv_figure import apparent_stiction
from monitoring.oscillation import Oscillation
from monitoring.stiction_features import StictionFeatures, active_part, stiction_features
from monitoring.stiction_model import StictionModel, stiction_model
from monitoring.stiction_result import Stiction, StictionEvidence, StictionVerdict
from monitoring.stiction_search import CLEAR, StictionSearch, stiction_search
from monitoring.wave_shapes import area_ratio, hagglund_index, he_index, rossi_scali_index


def stiction(
    stretch: Stretch,
    swings: Oscillation,
    *,
    op_span: float = 100.0,
    integrating: bool = False,
    compressed: bool = False,
) -> Stiction:
    """Judge the valve from the waves of OP and PV.

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
    found = None
    if np.ptp(stretch.op) > 1e-3 * op_span and np.ptp(stretch.pv) > 0:
        found = stiction_features(
            stretch.op, stretch.pv, stretch.error, swings, stretch.dt, integrating=integrating
        )
    if found is None:
        return _nothing_to_judge(stretch)
    model = stiction_model()
    part = active_part(swings, stretch.dt)
    first = model.probability(found.vector[None])
    probability, search = float(first[0]), None
    if probability >= model.flagged_from:
        search = stiction_search(stretch.op[part], stretch.pv[part], found.period)
        probability = float(model.searched(first, np.array([search.improvement or 0.0]))[0])
    verdict = StictionVerdict.UNDECIDED
    if probability >= model.stiction_from:
        verdict = StictionVerdict.STICTION
    elif probability < model.none_below:
        verdict = StictionVerdict.NONE
    size = apparent_stiction(stretch.op[part], stretch.pv[part], found.period)
    return Stiction(
        verdict=verdict,
        probability=probability,
        evidence=(*_evidence(found, integrating), _searched(search)),
        S=None if search is None or search.S is None else 100 * search.S / op_span,
        J=None if search is None or search.J is None else 100 * search.J / op_span,
        apparent_size=None if size is None else 100 * size / op_span,
        basis=_basis(stretch, swings, found, verdict, compressed, model),
    )


def _nothing_to_judge(stretch: Stretch) -> Stiction:
    return Stiction(
        verdict=StictionVerdict.UNDECIDED,
        probability=None,
        evidence=(),
        S=None,
        J=None,
        apparent_size=None,
        basis=refusal(
            "OP and PV do not move through three cycles of one period", share=stretch.share
        ),
    )


def _basis(
    stretch: Stretch,
    swings: Oscillation,
    found: StictionFeatures,
    verdict: StictionVerdict,
    compressed: bool,
    model: StictionModel,
) -> Basis:
    doubts = []
    if not swings.oscillates:
        doubts.append("there is no clear oscillation whose wave could be judged")
    if compressed:
        doubts.append("PV was compressed, which straightens waves")
    if found.period < 12:
        doubts.append(f"a cycle has only {found.period:.0f} samples")
    if found.cycle.cycles < 6:
        doubts.append(f"only {found.cycle.cycles} cycles are alike")
    if verdict is StictionVerdict.UNDECIDED:
        doubts.append("the probability lies between the two limits")
    settings: tuple[Setting, ...] = (
        ("period, s", found.period * stretch.dt),
        ("cycles", float(found.cycle.cycles)),
        ("stiction from", model.stiction_from),
        ("none below", model.none_below),
        ("fitted on", "simulated loops alone"),
    )
    grades = (Confidence.HIGH, Confidence.MEDIUM, Confidence.LOW)
    return Basis(
        share=stretch.share,
        confidence=grades[min(len(doubts), 2)],
        reasons=tuple(doubts),
        settings=settings,
    )


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
