"""Evidence of a group as one ranking."""

import numpy as np
import pytest

from monitoring.granger import Granger, GrangerArrow
from monitoring.origin import (
    NAMED_FROM,
    NAMES,
    LoopEvidence,
    net_flow,
    origin,
    origin_features,
    origin_model,
    strongest_arrow,
)
from monitoring.propagation import Propagation

NOTHING = Granger(arrows=(), order=None, conditional=False, reason="too short")
PLAIN = LoopEvidence(share=0.5, nonlinearity=None, stiction=None)


def arrow(cause: int, effect: int, strength: float, *, significant: bool = True) -> GrangerArrow:
    return GrangerArrow(
        cause=cause, effect=effect, strength=strength, p_value=0.0, beyond=9.0,
        significant=significant,
    )  # fmt: skip


def follows(first: int, second: int, delay: float, *, clear: bool) -> Propagation:
    return Propagation(
        first=first, second=second, delay=delay, error=0.1, sign=1, correlation=0.9, rival=20.0,
        clear=clear, phase_delay=None,
    )  # fmt: skip


def told(*arrows: GrangerArrow) -> Granger:
    return Granger(arrows=arrows, order=2, conditional=True)


def test_the_flow_is_what_goes_out_less_what_comes_in() -> None:
    """Square roots 2, 1 and 1 of 4: 0 sends 3/4, 1 gets 2 and sends 1, 2 gets 2."""
    found = net_flow(told(arrow(0, 1, 4.0), arrow(0, 2, 1.0), arrow(1, 2, 1.0)), 3)
    np.testing.assert_allclose(found, [0.75, -0.25, -0.5])
    np.testing.assert_array_equal(net_flow(NOTHING, 2), 0)
    np.testing.assert_array_equal(net_flow(told(arrow(0, 1, 4.0, significant=False)), 2), 0)


def test_the_strongest_arrow_is_that_of_those_that_count() -> None:
    found = told(arrow(0, 1, 0.25), arrow(1, 0, 0.09), arrow(1, 2, 4.0, significant=False))
    assert strongest_arrow(found) == 0.5
    assert strongest_arrow(NOTHING) == 0.0


def test_a_strong_arrow_speaks_against_a_cause_outside_and_for_no_loop() -> None:
    """In a ring everyone tells as much as it is told."""
    weak, strong = (
        origin((PLAIN,) * 3, told(*(arrow(k, (k + 1) % 3, s) for k in range(3))), (), 40.0)
        for s in (0.01, 0.5)
    )
    assert strong.elsewhere < weak.elsewhere
    assert strong.probabilities == pytest.approx([(1 - strong.elsewhere) / 3] * 3)


def test_features_are_what_they_are_called() -> None:
    loops = (
        LoopEvidence(share=0.9, nonlinearity=3.0, stiction=0.8),
        LoopEvidence(share=0.4, nonlinearity=1.0, stiction=None),
    )
    delays = (follows(0, 1, 5.0, clear=True),)
    found = origin_features(loops, told(arrow(0, 1, 0.1)), delays, 40.0)
    ahead = np.log(4.0) - np.log(2.0)
    assert found.shape == (2, len(NAMES))
    np.testing.assert_allclose(found[0], [ahead, np.log(4.0), 1.0, 0.5, 1.0, 0.5])
    np.testing.assert_allclose(found[1], [-ahead, 0.0, -1.0, -0.5, -1.0, -0.5])


def test_a_delay_that_is_not_clear_counts_by_its_phase_alone() -> None:
    (first, _) = origin_features((PLAIN, PLAIN), NOTHING, (follows(0, 1, 5.0, clear=False),), 40.0)
    assert first[NAMES.index("lead in phase")] == 0.5
    assert first[NAMES.index("lead that is clear")] == 0.0


def test_probabilities_add_up_and_grow_with_every_evidence() -> None:
    before = origin((PLAIN, PLAIN), NOTHING, (), 40.0)
    assert sum(before.probabilities) + before.elsewhere == pytest.approx(1.0)
    assert before.probabilities[0] == before.probabilities[1]
    assert before.named is None
    better = (
        origin((PLAIN, PLAIN), told(arrow(0, 1, 0.2)), (), 40.0),
        origin((PLAIN, PLAIN), NOTHING, (follows(0, 1, 8.0, clear=True),), 40.0),
        *(
            origin((LoopEvidence(share=a, nonlinearity=b, stiction=c), PLAIN), NOTHING, (), 40.0)
            for a, b, c in ((0.9, None, None), (0.5, 4.0, None), (0.5, None, 0.95))
        ),
    )
    for one in better:
        assert one.probabilities[0] > before.probabilities[0]
        assert one.probabilities[1] < before.probabilities[1]


def test_all_evidence_together_names_a_loop() -> None:
    sticks = LoopEvidence(share=0.8, nonlinearity=2.0, stiction=0.95)
    delays = (follows(0, 1, -8.0, clear=True),)
    found = origin((PLAIN, sticks), told(arrow(1, 0, 0.2)), delays, 40.0)
    assert found.named == 1
    assert found.probabilities[1] > NAMED_FROM


def test_the_weights_say_how_many_simulated_plants_they_rest_on() -> None:
    model = origin_model()
    assert model.weights.shape == (len(NAMES),)
    assert model.strongest < 0
    # Every kind of evidence speaks for the loop that has it.
    assert np.all(model.weights > 0)


def test_a_loop_alone_has_nobody_to_be_ahead_of() -> None:
    found = origin((LoopEvidence(share=0.9, nonlinearity=4.0, stiction=None),), NOTHING, (), 40.0)
    assert found.probabilities[0] == pytest.approx(1 - found.elsewhere)
    assert found.named is None
