"""Routine data of real refinery loops: a model, or a refusal with its reason, for every loop."""

from pathlib import Path

import numpy as np
import pytest

from advice.identifying import identified
from historian.csv_file import read_export
from historian.options import ReadOptions
from identification.running_controller import running_controller
from identification.verdict import Verdict
from loop.record import Mode, Record

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "refinery_loops"

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="../shared/data is not at hand")


@pytest.fixture(scope="module")
def episodes() -> dict[str, Record]:
    """The first episode of every loop."""
    options = ReadOptions(mode_codes={1: Mode.AUTO})
    first: dict[str, Path] = {}
    for path in sorted(DATA.glob("stic_*.txt")):
        first.setdefault(path.name.split("_Stick")[0].rsplit("_", 2)[0], path)
    return {loop: read_export(path, options=options).record() for loop, path in first.items()}


def test_every_loop_has_a_model_or_a_reason_in_words(episodes: dict[str, Record]) -> None:
    assert len(episodes) >= 17
    for loop, record in episodes.items():
        found = identified(record)
        assert (found.process is None) == (found.verdict is Verdict.REFUSED), loop
        assert found.reasons, loop
        assert all(reason.endswith(".") for reason in found.reasons), loop


def test_no_loop_without_a_set_point_move_gets_a_model(episodes: dict[str, Record]) -> None:
    still = 0
    for loop, record in episodes.items():
        assert record.sp is not None
        sp = record.sp[np.isfinite(record.sp)]
        if np.ptp(sp) == 0:
            still += 1
            found = identified(record)
            assert found.process is None, loop
            assert "the set point stood still" in found.reasons[0], loop
    assert still >= 8


def test_settings_are_read_or_refused_without_a_failure(episodes: dict[str, Record]) -> None:
    for loop, record in episodes.items():
        found = running_controller(record)
        assert (found.pid is None) == (found.verdict is Verdict.REFUSED), loop
        assert found.reasons, loop
