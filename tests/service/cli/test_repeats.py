"""`loopwright repeats`: several step tests of one loop together."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from service.cli import run

Said = Callable[[], tuple[str, str]]
T = np.arange(0.0, 500.0, 2.0)
OP = np.where(T < 100, 40.0, 50.0)


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    """Three tests of gain 2 and one in Fahrenheit."""
    names = []
    for seed, gain in enumerate((2.0, 2.0, 2.0, 3.6)):
        rise = np.where(T > 111, 1 - np.exp(-(T - 111) / 50), 0)
        pv = 20 + 10 * gain * rise + np.random.default_rng(seed).normal(0, 0.1, T.size)
        path = tmp_path / f"test-{seed + 1}.csv"
        rows = (f"{t:g},{x:.6f},{u:g}\n" for t, x, u in zip(T, pv, OP, strict=True))
        path.write_text("t [s],PV,OP\n" + "".join(rows))
        names.append(str(path))
    return names


def test_the_test_that_does_not_belong_is_named(files: list[str], said: Said) -> None:
    assert run(["repeats", *files]) == 0
    out, err = said()
    assert err == ""
    assert "3 of 4 tests count" in out
    assert "left out: test-4.csv" in out
    assert "Fahrenheit to Celsius" in out


def test_the_document_holds_the_pooled_model(files: list[str], said: Said) -> None:
    assert run(["repeats", *files, "--json"]) == 0
    found = json.loads(said()[0])
    assert found["process"]["kind"] == "FOPDT"
    for name, true in (("K", 2.0), ("tau", 50.0), ("theta", 11.0)):
        assert abs(found["process"][name] - true) < 4 * found["standard_errors"][name]
    assert found["used"] == [0, 1, 2]
    assert [test["test"] for test in found["left_out"]] == [3]


def test_one_test_is_no_repeat(files: list[str], said: Said) -> None:
    assert run(["repeats", files[0]]) == 3
    assert "two tests" in said()[0]
    assert run(["repeats", files[0], "--json"]) == 3
    assert "two tests" in json.loads(said()[0])["refused"]
