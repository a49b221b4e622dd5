"""The JSON document: the names of the contract, null for what is infinite, never NaN."""

import json
import math
from typing import Any

import pytest

from advice.case_body import case_body
from advice.tune import tune, tune_process
from loop.controller import PID
from loop.plants import PLANT, relay_test
from loop.process import FOPDT, IPDT
from loop.record import Record

MODEL = {"kind", "K", "tau", "theta", "verdict", "reasons"}
TUNING = {
    "rule", "structure", "form", "action", "Kc", "Ti", "Td", "N", "b", "c", "tau_c", "margins",
    "sweep", "passes",
}  # fmt: skip
MARGINS = {"gain", "gain_reduction", "phase", "delay", "Ms", "Mt"}


def document(case: Any) -> dict[str, Any]:
    body: dict[str, Any] = json.loads(json.dumps(case_body(case), allow_nan=False))
    return body


def test_the_document_has_the_names_of_the_contract(heater_test: Record) -> None:
    body = document(tune(heater_test))

    assert set(body["model"]) >= MODEL
    assert body["model"]["K"] == pytest.approx(2.0, rel=0.02)
    assert len(body["tunings"]) > 15
    for tuning in body["tunings"]:
        assert set(tuning) >= TUNING
        assert set(tuning["margins"]) == MARGINS
        assert tuning["form"] == "ISA"
    assert body["recommended"] in body["tunings"]
    assert body["recommended"]["passes"]
    assert body["recommended_reason"]


def test_null_stands_for_no_integral_and_for_infinite_margins() -> None:
    body = document(tune_process(FOPDT(K=2.0, tau=120.0, theta=30.0)))
    proportional = next(t for t in body["tunings"] if t["structure"] == "P")
    assert proportional["Ti"] is None
    integrating = document(tune_process(IPDT(K=0.01, theta=10.0)))
    assert integrating["model"] == {
        "kind": "IPDT", "K": 0.01, "tau": None, "theta": 10.0,
        "parameters": {"K": 0.01, "theta": 10.0}, "verdict": "stated",
        "reasons": ["The process was stated, not identified; its errors are not known."],
    }  # fmt: skip


def test_an_unstable_tuning_is_said_to_be_unstable() -> None:
    body = document(tune_process(FOPDT(K=2.0, tau=120.0, theta=1.0), scan_time=60.0))
    unstable = [t for t in body["tunings"] if not t["stable"]]

    assert unstable
    assert all(not t["passes"] and t["margins"]["gain"] == 0 for t in unstable)
    assert all(t["margins"]["Ms"] is None for t in unstable)


def test_the_sweep_shows_every_plant_and_the_worst_one() -> None:
    body = document(tune_process(FOPDT(K=2.0, tau=120.0, theta=30.0)))
    sweep = body["tunings"][0]["sweep"]

    assert sweep["parameters"] == ["K", "tau", "theta"]
    assert len(sweep["factors"]) == 11
    assert [len(row) for row in sweep["Ms"]] == [11, 11, 11]
    assert sweep["worst"]["Ms"]["value"] == pytest.approx(max(max(row) for row in sweep["Ms"]))
    assert len(sweep["corners"]["Ms"]) == 8
    nominal = body["tunings"][0]["margins"]["Ms"]
    assert all(row[5] == pytest.approx(nominal) for row in sweep["Ms"])


def test_a_refusal_keeps_the_shape(flat_record: Record) -> None:
    body = document(tune(flat_record))

    assert body["model"]["verdict"] == "refused"
    assert body["model"]["K"] is None
    assert body["tunings"] == []
    assert body["recommended"] is None
    assert body["recommended_reason"]


def test_a_relay_case_and_a_running_controller_keep_the_shape(square_wave: Record) -> None:
    modelled = document(tune(relay_test(PLANT[3]), relay_hysteresis=4 * PLANT[3].noise))["model"]
    assert modelled["kind"] == "FOPDT"
    assert set(modelled) >= MODEL
    assert modelled["relay"]["cycles"] > 10
    assert modelled["relay"]["exact"]["Ku"] == pytest.approx(3.47, rel=0.02)
    assert modelled["relay"]["Ku_low"] < 3.47 < modelled["relay"]["Ku_high"]

    relay = document(tune(square_wave))
    assert relay["model"]["kind"] == "relay"
    assert relay["model"]["Ku"] > 0
    assert set(relay["model"]) >= MODEL
    assert all(t["margins"] is None and not t["passes"] for t in relay["tunings"])

    running = document(
        tune_process(FOPDT(K=2.0, tau=120.0, theta=30.0), running=PID(Kc=0.5, Ti=math.inf))
    )["running"]
    assert running["Ti"] is None
    assert running["margins"]["Ms"] > 1
