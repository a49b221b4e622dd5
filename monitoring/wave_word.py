"""The word of the wave shapes on the valve, after the search for S and J where they are odd."""

import numpy as np

from loop.signals import Real
from monitoring.answer_model import WaveWord
from monitoring.oscillation import Oscillation
from monitoring.stiction_features import StictionFeatures, active_part, stiction_features
from monitoring.stiction_model import stiction_model
from monitoring.stiction_search import StictionSearch, stiction_search

# Waves of OP below this part of its range are not judged.
LEAST_WAVE = 1e-3


def wave_word(
    op: Real,
    pv: Real,
    error: Real,
    swings: Oscillation,
    dt: float,
    *,
    op_span: float,
    integrating: bool,
) -> tuple[WaveWord, StictionFeatures | None, StictionSearch | None]:
    """Judge the waves; without three cycles there is no word, and without suspicion no search.

    Parameters
    ----------
    op, pv, error : ndarray, shape (n,)
        Signals without gaps. [OP], [PV], [PV]
    swings : Oscillation
        Oscillations of the error.
    dt : float
        Sample time. [s]
    op_span : float
        Range of the output. [OP]
    integrating : bool
        Whether the process integrates.
    """
    found = None
    if np.ptp(op) > LEAST_WAVE * op_span:
        found = stiction_features(op, pv, error, swings, dt, integrating=integrating)
    if found is None:
        return WaveWord(clear=swings.oscillates), None, None
    model, search = stiction_model(), None
    first = model.probability(found.vector[None])
    probability = float(first[0])
    if probability >= model.flagged_from:
        part = active_part(swings, dt)
        search = stiction_search(op[part], pv[part], found.period)
        improvement = np.array([search.improvement or 0.0])
        probability = float(model.searched(first, improvement)[0])
    word = WaveWord(
        probability=probability,
        clear=swings.oscillates,
        share=float(found.vector[0]),
        op_likeness=found.cycle.op_likeness,
        pv_likeness=found.cycle.pv_likeness,
    )
    return word, found, search
