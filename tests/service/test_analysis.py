"""Analyses over REST: the document of the command line, and columns for many loops."""

import json
import math
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from advice.analyse import Task, analyse
from advice.analysis_body import analysis_body
from advice.model_export import TARGETS, export_model
from loop.controller import PID, Action
from loop.margins import margins
from loop.process import FOPDT

HEATER = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}
RUNNING = {"Kc": 0.45, "Ti": 135.0, "Td": 13.3}


# Nothing is stored, so one database is enough.
pytestmark = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


def asked(client: TestClient, **body: Any) -> dict[str, Any]:
    answer = client.post("/v1/analysis", json={"process": HEATER, "controller": RUNNING, **body})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_one_request_answers_everything_as_the_walk_itself_does(client: TestClient) -> None:
    body = asked(client, task={"load": 10.0, "allowed": 3.0})

    analysis = analyse(
        FOPDT(K=2, tau=120, theta=30), PID(Kc=0.45, Ti=135, Td=13.3), task=Task(load=10, allowed=3)
    )
    assert body == json.loads(json.dumps(analysis_body(analysis)))
    # The anchors of this loop.
    assert body["margins"]["gain"] == pytest.approx(7.28357, abs=5e-6)
    assert body["margins"]["Ms"] == pytest.approx(1.16282, abs=5e-6)
    assert body["lowest_peak"]["peak"] == pytest.approx(4.42, abs=0.005)
    assert body["lowest_peak"]["possible"] is False
    assert body["root_locus"]["crossings"][0]["k"] == pytest.approx(body["margins"]["gain"])
    assert body["nyquist"] == {"encirclements": 0, "open_loop": 0, "closed_loop": 0}
    assert body["bode_integral"]["integral"] == pytest.approx(0.0, abs=1e-9)
    assert set(body["figures"]) == {"bode", "nyquist", "nichols", "sensitivities", "root_locus"}
    for figure in body["figures"].values():
        assert {"data", "layout"} <= set(figure)
    curves = body["curves"]
    assert len({len(column) for column in curves.values()}) == 1
    L = np.array(curves["real"]) + 1j * np.array(curves["imag"])
    np.testing.assert_allclose(1 / np.abs(1 + L), curves["S"], rtol=1e-9)


def test_without_figures_the_answer_is_points_alone(client: TestClient) -> None:
    body = asked(client, figures=False, points=2)

    assert "figures" not in body
    assert len(body["curves"]["w"]) <= 2 + 4


def test_an_unstable_process_is_analysed_and_no_rule_is_offered(client: TestClient) -> None:
    process = {"kind": "TransferFunction", "numerator": [1], "denominator": [10, -1], "theta": 2}
    body = asked(client, process=process, controller={"Kc": 3.0})

    assert body["stable"] is True
    assert body["nyquist"] == {"encirclements": -1, "open_loop": 1, "closed_loop": 0}
    assert body["margins"]["gain_reduction"] == pytest.approx(1 / 3)
    assert {limit["bound"] for limit in body["limits"]} == {
        "wc at most", "wc at least", "Mt at least",
    }  # fmt: skip
    assert client.post("/v1/tunings", json={"process": process}).status_code == 422
    lost = asked(client, process=process, controller={"Kc": 0.5})
    assert (lost["stable"], lost["unstable_poles"], lost["margins"]) == (False, 1, None)
    assert "The closed loop is unstable" in lost["notes"][0]


def test_a_loop_without_end_to_its_unstable_poles_says_so(client: TestClient) -> None:
    body = asked(
        client,
        process={"kind": "FOPDT", "K": 2, "tau": 1, "theta": 1},
        controller={"Kc": 1, "Td": 5, "N": None},
    )

    assert body["unstable_poles"] is None
    assert body["poles"] is None
    assert "infinitely many" in body["notes"][0]


def test_a_notch_in_series_counts_in_the_margins(client: TestClient) -> None:
    w = 503.0
    resonance = {
        "kind": "TransferFunction",
        "numerator": [250 * w**2],
        "denominator": [1, 2 * 0.02 * w, w**2, 0, 0],
        "theta": 0,
    }
    notch = {"kind": "Notch", "w0": w, "zeta_zero": 0.05, "zeta_pole": 0.5}
    others = [
        {"kind": "Lead", "T": 1e-6, "alpha": 0.5},
        {"kind": "Lag", "T": 1e6, "beta": 1.0001},
        {"kind": "LeadLag", "T_lead": 1e-6, "T_lag": 1e-6},
    ]
    controller = {"Kc": 23.9, "Td": 0.012}
    assert not asked(client, process=resonance, controller=controller)["stable"]
    body = asked(
        client, process=resonance, controller=controller, compensators=[notch, *others],
        task={"load": 1.0, "frequency": 20.0, "wc": 900.0},
    )  # fmt: skip
    assert body["margins"]["phase"] == pytest.approx(35.0, abs=0.1)
    assert body["compensators"][0]["kind"] == "Notch"
    # There is no dead time, so the array is exact.
    assert body["routh"]["right"] == 0
    assert body["feasibility"]["possible"] is False
    assert len(body["disturbances"]) == 2


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"process": {**HEATER, "tau": -3.0}}, "greater than or equal to 0.000000001"),
        (
            {
                "process": {
                    "kind": "TransferFunction",
                    "numerator": [1, 2, 3],
                    "denominator": [1, 2],
                    "theta": 0,
                }
            },
            "must be proper: numerator of degree 2 over denominator of degree 1",
        ),
        (
            {
                "process": {
                    "kind": "TransferFunction",
                    "numerator": [0],
                    "denominator": [1, 2],
                    "theta": 0,
                }
            },
            "numerator must hold finite coefficients that are not all zero",
        ),
        ({"controller": {"Kc": -1.0}}, "greater than 0"),
        ({"controller": {"Kc": 1e-12}}, "Kc must lie within 1e-09 and 1e+09, got 1e-12"),
        (
            {"compensators": [{"kind": "Lead", "T": 1.0, "alpha": 2.0}]},
            "alpha of a lead must lie within 1e-6 and 1, got 2.0",
        ),
        ({"compensators": [{"kind": "Hat"}]}, "does not match any of the expected tags"),
        ({"task": {"allowed": 0.0}}, "greater than 0"),
        ({"profile": "any"}, "Input should be"),
        ({"points": 1}, "greater than or equal to 2"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence_with_numbers(
    client: TestClient, body: dict[str, Any], sentence: str
) -> None:
    answer = client.post("/v1/analysis", json={"process": HEATER, "controller": RUNNING, **body})

    assert answer.status_code == 422
    assert sentence in " ".join(fault["detail"] for fault in answer.json()["errors"])


def test_columns_answer_the_margins_of_many_loops(client: TestClient) -> None:
    thetas = np.linspace(1.0, 80.0, 200)
    answer = client.post(
        "/v1/analysis/batch",
        json={
            "process": {"K": -2.0, "tau1": 120.0, "theta": thetas.tolist()},
            "controller": {"Kc": 1.2, "Ti": 120.0, "Td": 10.0},
            "scan_time": 2.0,
        },
    )

    assert answer.status_code == 200, answer.text
    body = answer.json()
    assert body["count"] == 200
    assert set(map(len, (body[name] for name in body if name != "count"))) == {200}
    for i in (0, 57, 120):
        found = margins(
            FOPDT(K=-2, tau=120, theta=float(thetas[i])),
            PID(Kc=1.2, Ti=120, Td=10, action=Action.DIRECT),
            sample_time=2.0,
        )
        assert body["Ms"][i] == pytest.approx(found.Ms, rel=1e-9)
        assert body["gain"][i] == pytest.approx(found.gain, rel=1e-9)
    lost = body["stable"].index(False) if False in body["stable"] else None
    assert lost is None or (body["gain"][lost], body["Ms"][lost]) == (0.0, None)
    integral_off = client.post(
        "/v1/analysis/batch",
        json={"process": {"K": [1.0, 2.0], "integrators": 1}, "controller": {"Kc": 0.5}},
    ).json()
    assert integral_off["gain"] == [None, None]
    assert integral_off["phase"] == pytest.approx([90.0, 90.0])


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"process": {"K": [1.0, 2.0], "theta": [1.0, 2.0, 3.0]}}, "must be equally long"),
        ({"process": {"K": 0.0}}, "K must lie within 1e-09 and 1e+09 in size, got 0.0"),
        ({"controller": {"Kc": [1.0, -1.0]}}, "Kc must lie within 1e-09 and 1e+09, got -1.0"),
        ({"process": {"K": 1.0, "theta": []}}, "at least 1 item"),
    ],
)
def test_columns_that_cannot_be_are_refused(
    client: TestClient, body: dict[str, Any], sentence: str
) -> None:
    asked_for = {"process": {"K": 1.0, "tau1": 3.0}, "controller": {"Kc": 1.0}, **body}
    answer = client.post("/v1/analysis/batch", json=asked_for)

    assert answer.status_code == 422
    assert sentence in " ".join(fault["detail"] for fault in answer.json()["errors"])
    assert math.isfinite(len(answer.content))


def test_a_model_is_exported_as_a_script(client: TestClient) -> None:
    answer = client.post("/v1/analysis/export", json={"process": HEATER, "target": "julia"})

    assert answer.status_code == 200, answer.text
    script = export_model(FOPDT(K=2, tau=120, theta=30), "julia")
    assert answer.json() == {
        "target": "julia",
        "file_name": script.file_name,
        "text": script.text,
    }
    body = {"process": HEATER, "target": "gekko", "sample_time": 1e-6}
    refused = client.post("/v1/analysis/export", json=body)
    assert refused.status_code == 422
    assert "1000 is the most" in refused.json()["errors"][0]["detail"]


@pytest.mark.parametrize(
    ("process", "Td"),
    [
        ({"kind": "PureDelay", "K": 2.0, "theta": 5.0}, 0.0),
        ({"kind": "IntegratorWithLag", "K": 0.1, "tau": 5.0, "theta": 1.0}, 1.0),
        ({"kind": "DoubleIntegrator", "K": 0.1, "theta": 0.0}, 12.0),
        ({"kind": "IPDT", "K": -0.1, "theta": 3.0}, 1.0),
        ({"kind": "SOPDT", "K": 2.0, "tau1": 9.0, "tau2": 3.0, "theta": 0.0}, 1.0),
    ],
)
def test_every_kind_of_process_is_analysed_and_exported(
    client: TestClient, process: dict[str, Any], Td: float
) -> None:
    body = asked(
        client, process=process, controller={"Kc": 0.2, "Ti": 50.0, "Td": Td}, scan_time=0.1,
        task={"load": 1.0, "allowed": 9.0, "set_point_change": 1.0, "op_room": 99.0},
    )  # fmt: skip
    assert body["stable"] is True
    assert body["poles"] is not None
    # A gain with dead time alone has no falling L, and no such integral.
    pure = process["kind"] == "PureDelay"
    assert len(body["notes"]) == int(pure)
    assert body["root_locus"] is not None
    for target in TARGETS:
        wanted = {"process": process, "target": target}
        assert client.post("/v1/analysis/export", json=wanted).status_code == 200
