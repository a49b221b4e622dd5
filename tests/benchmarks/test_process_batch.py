"""The batch of processes: its size and shapes, and what two rules keep on some of it."""

from collections import Counter

import pytest

from benchmarks.process_batch import COLUMNS, kept_on, process_batch
from loop.half_rule import half_rule
from loop.margins import margins
from loop.process import TransferFunction, static_gain
from tuning.catalogue import RULES


def test_the_batch_has_the_families_of_the_list() -> None:
    counts = Counter(family for family, _ in process_batch())
    assert sum(counts.values()) == 133
    assert counts == {
        "P1": 21, "P2": 21, "P3": 10, "P4": 6, "P5": 9, "P6": 9, "P7": 36, "P8": 11, "P9": 10,
    }  # fmt: skip
    assert all(
        static_gain(process) == pytest.approx(1.0)
        for family, process in process_batch()
        if family not in ("P6", "P7")
    )


def test_simc_keeps_its_margins_on_the_processes_it_was_made_for() -> None:
    """Second route: printed, Ms 1.590 on a first-order process; 1.463 for E4, 1/(s + 1)^4."""
    first = TransferFunction((1.0,), (2.0, 1.0), 1.0)
    fourth = next(p for f, p in process_batch() if f == "P4" and len(p.denominator) == 5)
    for process, Ms in ((first, 1.590), (fourth, 1.463)):
        found = {k.column: k for k in kept_on("P", process)}
        assert set(found) == set(COLUMNS)
        assert found["SIMC PI"].Ms == pytest.approx(Ms, abs=5e-4)
        assert found["SIMC PI"].stable
    refused = {k.column: k for k in kept_on("P1", first)}["SIMC PID"]
    assert refused.refusal is not None
    assert "no second lag" in refused.refusal


@pytest.mark.parametrize("family", ["P3", "P6", "P8", "P9"])
def test_a_member_of_each_kind_keeps_what_the_scalar_margins_say(family: str) -> None:
    process = [p for f, p in process_batch() if f == family][4]
    for kept in kept_on(family, process):
        rule, structure, order = COLUMNS[kept.column]
        pid = RULES[rule].structures[structure](
            half_rule(process, order=1 if order == 1 else 2).model
        )
        assert kept.Ms == pytest.approx(margins(process, pid).Ms, rel=1e-6)
        assert kept.area == pytest.approx(pid.Ti / pid.Kc)
