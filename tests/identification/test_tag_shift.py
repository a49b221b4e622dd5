"""Time stamps of PV, SP and OP: shifts are seen in automatic, and cost a model its trust."""

import numpy as np
import pytest

from advice.identifying import identified
from identification.tag_shift import TagShift, judge_tag_shift, tag_shifts
from identification.verdict import Verdict
from loop.record import Mode, Record
from loop.signals import Real

N, THETA = 2400, 10


def loop(noise: float, Kc: float, *, b: float = 1.0, seed: int = 0) -> tuple[Real, Real, Real]:
    """PV, SP and OP of a PI loop on K 2, tau 40 s, theta 10 s, with a wandering load."""
    rng = np.random.default_rng(seed)
    pv, op = np.zeros(N), np.zeros(N)
    sp = np.where(np.arange(N) % 800 < 400, 50.0, 51.0)
    a, x, load, integral, before = np.exp(-1 / 40), 0.0, 0.0, 40.0, [40.0] * (THETA + 1)
    for i in range(N):
        load = 0.98 * load + 0.02 * rng.normal()
        x = a * x + (1 - a) * 2.0 * (before[0] - 40.0)
        pv[i] = 50 + x + load + noise * rng.normal()
        integral += Kc / 40 * (sp[i] - pv[i])
        op[i] = integral + Kc * (b * (sp[i] - 50) + 50 - pv[i])
        before = [*before[1:], op[i]]
    return pv, sp, op


def record(pv: Real, sp: Real, op: Real) -> Record:
    mode = np.full(pv.size, Mode.AUTO, dtype=np.int8)
    return Record(t=np.arange(float(pv.size)), pv=pv, sp=sp, op=op, mode=mode)


@pytest.mark.parametrize(("noise", "Kc"), [(0.05, 0.5), (0.3, 0.3), (0.01, 1.5)])
@pytest.mark.parametrize("late", [0, 3, -4])
def test_the_shift_of_a_tag_is_found_to_the_sample(noise: float, Kc: float, late: int) -> None:
    pv, sp, op = loop(noise, Kc)
    shifted = record(np.roll(pv, late)[10:-10], sp[10:-10], op[10:-10])
    of_pv = next(found for found in tag_shifts(shifted) if found.cause == "PV")
    assert of_pv.samples == -late
    assert of_pv.together == (late == 0)


def test_a_set_point_that_is_stamped_wrongly_is_found_by_its_kick() -> None:
    pv, sp, op = loop(0.01, 1.0)
    shifts = {f.cause: f.samples for f in tag_shifts(record(pv, np.roll(sp, 2), op))}
    assert shifts == {"PV": 0, "SP": -2}
    pv, sp, op = loop(0.01, 1.0, b=0.0)  # without the kick nothing is said of SP
    assert {f.cause for f in tag_shifts(record(pv, sp, op))} == {"PV"}


def test_a_process_that_answers_the_kicks_of_the_set_point_is_no_late_stamp() -> None:
    t = np.arange(float(N))
    sp = np.where(t % 300 < 150, 50.0, 52.0)
    kicks = np.diff(sp, prepend=sp[0])
    # OP moves with SP alone; PV answers it seven samples later, far above the little noise.
    op = 40 + np.cumsum(kicks) + 0.001 * np.random.default_rng(3).normal(size=N)
    pv = np.roll(2.0 * (op - 40), 7) + 0.01 * np.random.default_rng(4).normal(size=N)
    found = {f.cause: f.samples for f in tag_shifts(record(pv[10:], sp[10:], op[10:]))}
    assert found == {"SP": 0}


def test_nothing_is_said_in_manual_of_steps_or_without_a_controller() -> None:
    pv, sp, op = loop(0.05, 0.5)
    manual = Record(t=np.arange(float(N)), pv=pv, op=op)
    assert tag_shifts(manual) == []
    noise = np.random.default_rng(1).normal(size=N)
    assert tag_shifts(record(pv, sp, 40 + np.cumsum(noise))) == []
    assert tag_shifts(record(np.full(N, 50.0), np.full(N, 50.0), op)) == []
    assert tag_shifts(record(pv[:50], sp[:50], op[:50])) == []


def test_a_shift_counts_against_the_speed_of_the_process() -> None:
    def judged(samples: int, cause: str = "PV") -> Verdict:
        found = TagShift(cause=cause, samples=samples, seconds=float(samples), strength=20.0)
        return judge_tag_shift(found, 50.0).verdict

    assert [judged(k) for k in (0, 1, -1, 3, -30, 30)] == [
        Verdict.TRUSTED, Verdict.TRUSTED, Verdict.CARE, Verdict.CARE, Verdict.REFUSED,
        Verdict.REFUSED,
    ]  # fmt: skip
    assert judged(-2, "SP") is Verdict.CARE


def test_routine_data_with_a_late_pv_lose_their_trust_and_say_by_how_much() -> None:
    pv, sp, op = loop(0.02, 0.8)
    good = identified(record(pv, sp, op))
    assert any("belong together" in reason for reason in good.reasons)
    late = identified(record(np.roll(pv, 4)[4:], sp[4:], op[4:]))
    if late.process is not None:
        assert late.verdict is Verdict.CARE
        assert any("dead time of the model is too long by 4 s" in text for text in late.reasons)
