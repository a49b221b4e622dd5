"""`loopwright sheet`, from a tuning to an approved version, by two people."""

import re
from collections.abc import Callable
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL

from service.cli import run

Said = Callable[[], tuple[str, str]]
Body = dict[str, Any]
HEATER = {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0}


@pytest.fixture(params=["sqlite"])
def database_url(request: pytest.FixtureRequest) -> URL:
    """One kind will do, except for the walk from the tuning to the version in force."""
    url: URL = request.getfixturevalue(f"{request.param}_url")
    return url


@pytest.fixture
def tuning(client: TestClient, tic101: Body) -> Body:
    answer = client.post(f"/v1/loops/{tic101['id']}/tunings", json={"process": HEATER})
    assert answer.status_code == 201, answer.text
    body: Body = answer.json()
    return body


@pytest.fixture
def drafted(tuning: Body, acting_as: Callable[[str, str], str], said: Said) -> Body:
    """Have Anna draft version 1, with Berta's key set afterwards."""
    acting_as("Anna", "engineer")
    call = ["sheet", "draft", "TIC-101", "--tuning", tuning["id"], "--reason", "Step test of May"]
    assert run(call) == 0
    said()
    acting_as("Berta", "approver")
    return tuning


def sheet(client: TestClient, loop: Body, version: int) -> Body:
    body: Body = client.get(f"/v1/loops/{loop['id']}/sheets/{version}").json()
    return body


@pytest.mark.parametrize("database_url", ["sqlite", "postgresql"], indirect=True)
def test_two_people_put_a_tuning_in_force(
    client: TestClient,
    tic101: Body,
    tuning: Body,
    acting_as: Callable[[str, str], str],
    said: Said,
) -> None:
    anna = acting_as("Anna", "engineer")
    for rule in ([], ["--rule", "amigo", "--structure", "PI"]):
        call = ["sheet", "draft", "TIC-101", "--tuning", tuning["id"], "--reason", "Test of May"]
        assert run([*call, *rule]) == 0
    assert "Version 2, draft, profile general" in said()[0]
    berta = acting_as("Berta", "approver")
    for version in ("1", "2"):
        assert run(["sheet", "approve", "TIC-101", version, "--reason", "Discussed"]) == 0
    assert "Version 2, approved" in said()[0]

    first, second = sheet(client, tic101, 1), sheet(client, tic101, 2)
    assert (first["status"], second["status"]) == ("superseded", "approved")
    assert first["settings"]["Kc"] == pytest.approx(tuning["recommended"]["Kc"], rel=1e-12)
    (amigo,) = [t for t in tuning["tunings"] if (t["rule"], t["structure"]) == ("amigo", "PI")]
    assert second["settings"]["Kc"] == pytest.approx(amigo["Kc"], rel=1e-12)
    lines = client.get(f"/v1/audit?loop_id={tic101['id']}").json()["items"]
    assert [(line["action"], line["actor"], line["key_id"]) for line in lines[:4]] == [
        ("sheet.approved", "Berta", berta),
        ("sheet.approved", "Berta", berta),
        ("sheet.drafted", "Anna", anna),
        ("sheet.drafted", "Anna", anna),
    ]
    assert run(["audit", "verify"]) == 0


@pytest.mark.usefixtures("drafted")
def test_a_version_is_shown_as_the_service_holds_it(
    client: TestClient, tic101: Body, said: Said
) -> None:
    assert run(["sheet", "approve", "TIC-101", "1", "--reason", "Discussed"]) == 0
    said()
    assert run(["sheet", "show", "TIC-101"]) == 0

    out, _ = said()
    held = sheet(client, tic101, 1)
    assert "by Anna: Step test of May" in out
    assert "by Berta: Discussed" in out
    assert "Margins at FOPDT K 2, tau 120, theta 30" in out
    shown = dict(re.findall(r"^  (\w+) +([-\d.e+]+)", out, re.MULTILINE))
    for name in ("Kc", "Ti", "Td", "N"):
        assert float(shown[name]) == pytest.approx(held["settings"][name], rel=5e-4)
    for name in ("gain", "phase", "delay", "Ms", "Mt"):
        assert float(shown[name]) == pytest.approx(held["evidence"]["margins"][name], rel=5e-4)
    assert held["evidence"]["verdict"] in out


def test_history_and_differences_name_versions_and_fields(
    drafted: Body, said: Said, acting_as: Callable[[str, str], str]
) -> None:
    acting_as("Anna", "engineer")
    call = ["sheet", "draft", "TIC-101", "--tuning", drafted["id"], "--reason", "Slower"]
    assert run([*call, "--rule", "amigo", "--structure", "PI"]) == 0
    said()

    assert run(["sheet", "history", "TIC-101"]) == 0
    lines = said()[0].splitlines()
    assert [line.split()[0] for line in lines] == ["VERSION", "2", "1"]
    assert lines[1].endswith("Slower")
    assert run(["sheet", "diff", "TIC-101", "1", "2"]) == 0
    assert re.search(r"^settings.Kc +0\.\d+ -> 0\.\d+$", said()[0], re.MULTILINE)
    assert run(["sheet", "diff", "TIC-101", "1", "1"]) == 0
    assert said()[0] == "Versions 1 and 1 of TIC-101 do not differ.\n"


def test_who_wrote_a_draft_may_approve_it_only_if_the_site_says_so(
    tuning: Body,
    acting_as: Callable[[str, str], str],
    sentence: Callable[[], str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    acting_as("Berta", "approver")
    draft = ["sheet", "draft", "TIC-101", "--tuning", tuning["id"], "--reason", "Step test"]
    assert run(draft) == 0
    approve = ["sheet", "approve", "TIC-101", "1", "--reason", "It is so"]
    assert run(approve) == 1
    assert "Berta wrote this draft, so somebody else has to approve it" in sentence()

    monkeypatch.setenv("LOOPWRIGHT_ALLOW_SELF_APPROVAL", "true")
    assert run(approve) == 0


@pytest.mark.usefixtures("drafted")
@pytest.mark.parametrize(
    ("arguments", "code", "because"),
    [
        ("approve TIC-101 2 --reason because", 1, "There is no sheet version 2"),
        ("approve TIC-999 1 --reason because", 1, "There is no loop TIC-999"),
        ("approve TIC-101 1 --reason x", 2, "--reason: String should have at least 3"),
        ("approve TIC-101 1", 2, "Missing option '--reason'"),
        ("approve TIC-101 0 --reason because", 2, "'VERSION'"),
        ("approve TIC-101 one --reason because", 2, "'VERSION'"),
        (
            "draft TIC-101 --tuning 5167b2b8-e9b0-4c6d-84a4-fb47b61b0796 --reason because",
            1,
            "There is no tuning",
        ),
        ("draft TIC-101 --tuning best --reason because", 2, "'--tuning'"),
        ("show TIC-101", 1, "There is no approved sheet of loop TIC-101"),
        ("show TIC-101 --version 7", 1, "There is no sheet version 7"),
        ("diff TIC-101 1 7", 1, "There is no sheet version 7"),
        ("history TIC-999", 1, "There is no loop TIC-999"),
    ],
)
def test_what_cannot_be_done_with_a_sheet_is_said(
    arguments: str, code: int, because: str, sentence: Callable[[], str]
) -> None:
    assert run(["sheet", *arguments.split()]) == code
    assert because in sentence()


def test_a_decision_is_made_once_and_by_somebody_who_may(
    drafted: Body, acting_as: Callable[[str, str], str], sentence: Callable[[], str]
) -> None:
    approve = ["sheet", "approve", "TIC-101", "1", "--reason", "It is so"]
    acting_as("Egon", "engineer")
    assert run(approve) == 1
    assert "needs the role approver" in sentence()
    acting_as("Vera", "viewer")
    assert run(["sheet", "draft", "TIC-101", "--tuning", drafted["id"], "--reason", "Mine"]) == 1
    assert "needs the role engineer" in sentence()

    acting_as("Berta", "approver")
    assert run(approve) == 0
    assert run(approve) == 1
    assert "Sheet version 1 is approved; only a draft can be decided on" in sentence()
