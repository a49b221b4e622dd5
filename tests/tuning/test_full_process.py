"""Rules on processes of any order: by the half rule, held to the process itself."""

from dataclasses import replace

import pytest

from loop.controller import Action
from loop.errors import RuleNotApplicable
from loop.half_rule import half_rule
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, PureDelay, TransferFunction
from tuning.answer import tunings
from tuning.catalogue import RULES
from tuning.full_process import is_low_order, on_full_process, recommend_on_both, simplest
from tuning.profiles import PROFILES, Profile

GENERAL = PROFILES["general"]
COLUMN = TransferFunction((-0.3, 1.0), (0.8, 3.2, 3.4, 1.0), 0.5)
VESSEL = TransferFunction((-2.0,), (1.0, 2.0, 1.0, 0.0), 0.3)


@pytest.mark.parametrize(
    ("process", "simple"),
    [
        (TransferFunction((2.0,), (120.0, 1.0), 30.0), FOPDT(K=2.0, tau=120.0, theta=30.0)),
        (TransferFunction((4.0,), (240.0, 2.0), 30.0), FOPDT(K=2.0, tau=120.0, theta=30.0)),
        (TransferFunction((1.0,), (8.0, 6.0, 1.0), 1.0), SOPDT(K=1, tau1=4.0, tau2=2.0, theta=1.0)),
        (TransferFunction((-3.0,), (2.0, 0.0), 1.0), IPDT(K=-1.5, theta=1.0)),
        (TransferFunction((3.0,), (2.0, 0.0, 0.0), 1.0), DoubleIntegrator(K=1.5, theta=1.0)),
        (TransferFunction((3.0,), (2.0,), 1.0), PureDelay(K=1.5, theta=1.0)),
        (COLUMN, COLUMN),
        (TransferFunction((1.0,), (-1.0, 1.0)), TransferFunction((1.0,), (-1.0, 1.0))),
    ],
)
def test_a_low_order_model_is_known_however_it_is_written(
    process: TransferFunction, simple: Process
) -> None:
    assert simplest(process) == simple
    assert simplest(simple) == simple
    assert is_low_order(simple) == (simple != process)


def test_an_integrator_with_a_lag_stays_as_it_is() -> None:
    process = TransferFunction((1.0,), (2.0, 1.0, 0.0), 0.5)
    assert simplest(process) is process
    assert tunings(process, GENERAL).reductions == ()


@pytest.mark.parametrize("process", [COLUMN, VESSEL], ids=["zero", "integrator"])
def test_every_column_answers_on_the_closest_model_it_takes(process: TransferFunction) -> None:
    found = tunings(process, GENERAL)
    first, second = found.reductions
    assert (first, second) == (half_rule(process, order=1), half_rule(process, order=2))
    columns = {(t.proposal.rule, t.proposal.structure): t for t in found.tunings}
    for (name, structure), answer in columns.items():
        kinds = RULES[name].takes[structure]
        models = [m for m in (second, first) if type(m.model).__name__ in kinds]
        assert (answer.full is None) == (answer.proposal.pid is None)
        if answer.full is not None:
            assert answer.full.reduction == models[0]
            assert "by the half rule" in " ".join(answer.proposal.notes)


@pytest.mark.parametrize("process", [COLUMN, VESSEL], ids=["zero", "integrator"])
def test_margins_on_the_process_are_the_scalar_ones(process: TransferFunction) -> None:
    """Second route: one loop at a time."""
    for tuning in tunings(process, GENERAL, sample_time=0.2).tunings[::6]:
        if tuning.proposal.pid is None or tuning.full is None or not tuning.full.stable:
            continue
        alone = margins(process, tuning.proposal.pid, sample_time=0.2)
        assert tuning.full.margins.Ms == pytest.approx(alone.Ms, rel=1e-6)
        assert tuning.full.margins.phase == pytest.approx(alone.phase, rel=1e-6)


def test_what_is_recommended_holds_on_the_model_and_on_the_process() -> None:
    found = tunings(COLUMN, GENERAL)
    assert found.recommendation.index is not None
    best = found.tunings[found.recommendation.index]
    assert best.passes
    assert best.full is not None
    assert best.full.sentence in found.recommendation.reason
    assert "On the full process the profile holds" in found.recommendation.reason


def test_settings_that_fail_on_the_process_alone_are_not_recommended() -> None:
    """Settings that pass on the model, held to a stricter profile on the process."""
    pid = tunings(COLUMN, GENERAL).tunings[0].proposal.pid
    assert pid is not None
    strict = Profile(name="mine", gain=8.0, phase=80.0, Ms=1.1, Mt=1.0, delay_over_theta=50.0)
    (found,) = on_full_process(COLUMN, [(pid, half_rule(COLUMN))], strict)
    assert not found.passes
    assert len(found.missed) == 5
    assert found.sentence.startswith("On the full process the gain margin is")
    fast = RULES["simc"].structures["PI"](half_rule(COLUMN).model, 0.01)
    hot = type(fast)(Kc=fast.Kc * 3, Ti=0.5)
    (lost,) = on_full_process(COLUMN, [(hot, half_rule(COLUMN))], GENERAL)
    assert (lost.stable, lost.passes) == (False, False)
    assert lost.sentence == "On the full process the loop is unstable."
    assert on_full_process(COLUMN, [], GENERAL) == []


def test_what_passes_on_the_model_alone_is_not_recommended_and_that_is_told() -> None:
    found = tunings(COLUMN, GENERAL)
    proposals = [t.proposal for t in found.tunings]
    verified = [t.verification for t in found.tunings]
    lost = [
        None if t.full is None else replace(t.full, missed=("Ms is 3 above 2",))
        for t in found.tunings
    ]
    answer = recommend_on_both(proposals, verified, lost)
    assert answer.index is None
    assert answer.reason.endswith("The best on the model: On the full process Ms is 3 above 2.")
    nothing = recommend_on_both(proposals, [None] * len(proposals), lost)
    assert "No rule has settings" in nothing.reason


def test_two_integrators_with_a_lag_have_one_model_alone() -> None:
    found = tunings(TransferFunction((1.0,), (1.0, 1.0, 0.0, 0.0), 1.0), GENERAL)
    (only,) = found.reductions
    assert only.model == DoubleIntegrator(K=1.0, theta=1.5)
    assert found.recommendation.index is None


def test_a_chosen_speed_reaches_the_rules_on_a_model_too() -> None:
    found = tunings(COLUMN, GENERAL, tau_c=5.0)
    simc = found.tunings[0].proposal
    assert (simc.tau_c, simc.tau_c_reason) == (5.0, "as chosen")
    with pytest.raises(ValueError, match="tau_c"):
        tunings(COLUMN, GENERAL, tau_c=-1.0)


def test_the_sign_of_the_gain_turns_the_action_and_nothing_else() -> None:
    mirrored = TransferFunction((0.3, -1.0), (0.8, 3.2, 3.4, 1.0), 0.5)
    for here, there in zip(
        tunings(COLUMN, GENERAL).tunings, tunings(mirrored, GENERAL).tunings, strict=True
    ):
        if here.proposal.pid is None:
            assert there.proposal.pid is None
            continue
        assert there.proposal.pid is not None
        assert here.full is not None
        assert there.full is not None
        assert there.proposal.pid.action is Action.DIRECT
        assert there.proposal.pid.Kc == pytest.approx(here.proposal.pid.Kc)
        assert there.full.margins.Ms == pytest.approx(here.full.margins.Ms)


@pytest.mark.parametrize(
    ("process", "words"),
    [
        (TransferFunction((1.0,), (-3.0, 1.0), 1.0), "the process is unstable"),
        (TransferFunction((1.0,), (4.0, 4.4, 1.4, 1.0), 1.0), "oscillates by itself"),
        (TransferFunction((1.0, 0.0), (1.0, 1.0), 1.0), "passes no constants"),
        (TransferFunction((2.0,), (1.0,)), "no lag and no dead time"),
    ],
)
def test_a_process_no_rule_covers_is_refused_with_the_reason(
    process: TransferFunction, words: str
) -> None:
    with pytest.raises(RuleNotApplicable, match=words):
        tunings(process, GENERAL)
