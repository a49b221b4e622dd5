"""Loop sheets: drafted, decided on, compared, and never changed."""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from uuid import UUID

import pytest
from fastapi.testclient import TestClient
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from loop.controller import PID
from loop.margins import margins
from loop.process import FOPDT
from service.app import create_app
from service.database import Database
from service.settings import Settings
from service.tables import ModelRow, SheetDecisionRow, SheetRow, TuningRow
from tuning.profiles import PROFILES
from tuning.verification import verify

Body = dict[str, Any]

# What is decided before the database is asked needs no second one.
on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
HEATER = {"K": 2.0, "tau": 120.0, "theta": 30.0}
ISA: Body = {
    "form": "isa",
    "Kc": 0.45,
    "Ti": 135.0,
    "Td": 13.3,
    "anti_windup": "back_calculation",
    "Tt": 42.4,
}


@pytest.fixture
def model_id(sessions: sessionmaker[Session], tic101: Body) -> str:
    """Store the heater of the anchors as a model of TIC-101."""
    row = ModelRow(
        loop_id=UUID(tic101["id"]),
        kind="FOPDT",
        parameters=HEATER,
        verdict="trusted",
        reasons=[],
        body={},
        author="Anna",
    )
    with sessions.begin() as session:
        session.add(row)
    return str(row.id)


@pytest.fixture
def anna(client_as: Callable[..., TestClient]) -> TestClient:
    return client_as("engineer", owner="Anna")


@pytest.fixture
def berta(client_as: Callable[..., TestClient]) -> TestClient:
    return client_as("approver", owner="Berta")


def draft(client: TestClient, loop: Body, **changes: object) -> Body:
    body = {"settings": ISA, "reason": "first settings"} | changes
    answer = client.post(f"/v1/loops/{loop['id']}/sheets", json=body)
    assert answer.status_code == 201, answer.text
    found: Body = answer.json()
    return found


def decide(client: TestClient, loop: Body, version: int, what: str, etag: str | None = None) -> Any:
    address = f"/v1/loops/{loop['id']}/sheets/{version}"
    tag = etag or client.get(address).headers["etag"]
    return client.post(f"{address}/{what}", json={"reason": "it is so"}, headers={"If-Match": tag})


def statuses(client: TestClient, loop: Body) -> dict[int, str]:
    items = client.get(f"/v1/loops/{loop['id']}/sheets").json()["items"]
    return {sheet["version"]: sheet["status"] for sheet in items}


def test_a_draft_holds_what_was_written_and_the_margins_of_its_model(
    anna: TestClient, tic101: Body, model_id: str
) -> None:
    sheet = draft(anna, tic101, model_id=model_id, reason="heater, lambda = tau")

    assert (sheet["version"], sheet["status"], sheet["author"]) == (1, "draft", "Anna")
    assert (sheet["settings"]["Kc"], sheet["settings"]["N"]) == (0.45, 10.0)
    assert sheet["units"]["Kc"] == "%/degC"
    assert sheet["profile"] == tic101["profile"] == "general"
    assert sheet["process"] == {"kind": "FOPDT", **HEATER}
    # The anchor of the heater (gain, phase, delay, Ms, Mt), here without a scan time.
    found = sheet["evidence"]["margins"]
    assert found["gain"] == pytest.approx(7.28357, abs=5e-6)
    assert found["phase"] == pytest.approx(84.2356, abs=5e-5)
    assert found["delay"] == pytest.approx(219.311, abs=5e-4)
    assert found["Ms"] == pytest.approx(1.16282, abs=5e-6)
    assert found["Mt"] == pytest.approx(1.0, abs=1e-5)
    assert sheet["evidence"]["passes"] is True
    assert "general" in sheet["evidence"]["verdict"]
    assert sheet["decision"] is None


@on_sqlite
def test_margins_count_the_scan_time_and_the_pv_filter(
    anna: TestClient, tic101: Body, model_id: str
) -> None:
    settings = ISA | {"scan_time": 20.0, "pv_filter": 12.0}
    sheet = draft(anna, tic101, model_id=model_id, settings=settings, profile="process")

    pid = PID(Kc=0.45, Ti=135.0, Td=13.3, tauF=12.0)
    later = FOPDT(**(HEATER | {"theta": 40.0}))  # the hold of 20 s is 10 s of dead time
    expected = margins(later, pid)
    assert sheet["evidence"]["margins"]["gain"] == pytest.approx(expected.gain)
    assert sheet["evidence"]["margins"]["Ms"] == pytest.approx(expected.Ms)
    verdict = verify(FOPDT(**HEATER), pid, PROFILES["process"], sample_time=20.0)
    assert sheet["evidence"]["passes"] == verdict.passes


@on_sqlite
def test_margins_from_the_client_are_not_taken(anna: TestClient, tic101: Body) -> None:
    answer = anna.post(
        f"/v1/loops/{tic101['id']}/sheets",
        json={"settings": ISA, "reason": "trust me", "margins": {"gain": 99}},
    )

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == "body/margins"
    assert draft(anna, tic101)["evidence"] is None


@on_sqlite
def test_settings_in_the_blocks_form_and_units_are_the_same_controller(
    client: TestClient, anna: TestClient, tic101: Body, model_id: str
) -> None:
    """The heater's controller in %/% (200 degC over 100 %), minutes, as parallel gains."""
    client.patch(
        f"/v1/loops/{tic101['id']}",
        json={"form": "parallel", "time_unit": "min", "gain_basis": "percent"},
        headers={"If-Match": '"1"'},
    )
    Kp = 0.45 * 2
    settings = {
        "form": "parallel",
        "Kp": Kp,
        "Ki": Kp / (135 / 60),
        "Kd": Kp * 13.3 / 60,
        "Tf": 1.33 / 60,
        "anti_windup": "clamping",
    }

    sheet = draft(anna, tic101, settings=settings, model_id=model_id)

    assert sheet["units"]["Ki"] == "%/%/min"
    assert sheet["block"]["time_unit"] == "min"
    assert sheet["canonical"] == {
        "Kc": pytest.approx(0.45),
        "Ti": pytest.approx(135),
        "Td": pytest.approx(13.3),
        "N": pytest.approx(10),
        "b": 1.0,
        "c": 0.0,
        "tauF": 0.0,
        "action": "reverse",
    }
    assert sheet["evidence"]["margins"]["gain"] == pytest.approx(7.28357, abs=5e-6)


@pytest.mark.parametrize(
    ("change", "pointer", "detail"),
    [
        ({"form": "series"}, "body/settings/form", "has the form isa, these settings have series"),
        ({"op_high": 120.0}, "body/settings/op_high", "within the OP range 0 to 100 %, got 120"),
        ({"op_low": 60.0, "op_high": 40.0}, "body/settings/isa", "op_high must be above op_low"),
        ({"Tt": None}, "body/settings/isa", "back_calculation needs it"),
        ({"anti_windup": "none"}, "body/settings/isa", "Tt belongs to back_calculation"),
        ({"Kc": -0.45}, "body/settings/isa/Kc", "greater than or equal to 0.000000001"),
        ({"Ti": 0.0}, "body/settings/isa/Ti", "greater than or equal to 0.000000001"),
        ({"Kp": 1.0}, "body/settings/isa/Kp", "Extra inputs are not permitted"),
        ({"form": "ideal"}, "body/settings", "does not match any of the expected tags"),
    ],
)
@on_sqlite
def test_settings_that_are_no_controller_of_the_block_are_named(
    anna: TestClient, tic101: Body, change: Body, pointer: str, detail: str
) -> None:
    settings = ISA | change
    if settings["form"] == "series":
        settings["alpha"] = 0.1
    body = {"settings": settings, "reason": "wrong"}

    answer = anna.post(f"/v1/loops/{tic101['id']}/sheets", json=body)

    assert answer.status_code == 422
    (fault,) = answer.json()["errors"]
    assert fault["pointer"] == pointer
    assert detail in fault["detail"]


@on_sqlite
def test_a_gain_beyond_every_plant_is_refused_in_words(
    client: TestClient, anna: TestClient, tic101: Body
) -> None:
    address = f"/v1/loops/{tic101['id']}"
    change = {"gain_basis": "percent", "pv_high": 1e-3}
    client.patch(address, json=change, headers={"If-Match": '"1"'})
    body = {"settings": ISA | {"Kc": 1e6}, "reason": "a slip\nof the keyboard"}

    answer = anna.post(f"{address}/sheets", json=body)

    assert answer.status_code == 422
    (fault,) = answer.json()["errors"]
    assert fault["pointer"] == "body/settings"
    assert fault["detail"].startswith("Kc must lie within 1e-09 and 1e+09, got 100000000000")
    bell = anna.post(f"{address}/sheets", json=body | {"reason": "ring\x07"})
    assert bell.json()["errors"][0]["pointer"] == "body/reason"


def test_a_controller_that_its_own_model_says_is_unstable_is_not_stored(
    anna: TestClient, tic101: Body, model_id: str
) -> None:
    """Minutes typed as seconds: Ti 2.25 in a block that counts seconds."""
    body = {"settings": ISA | {"Kc": 5.0, "Ti": 2.25}, "model_id": model_id, "reason": "a slip"}

    answer = anna.post(f"/v1/loops/{tic101['id']}/sheets", json=body)

    assert answer.status_code == 422
    assert answer.json()["type"] == "/problems/unstable-loop"
    assert answer.json()["unstable_poles"] >= 1
    assert statuses(anna, tic101) == {}


@on_sqlite
def test_settings_without_an_isa_form_are_refused(
    client: TestClient, anna: TestClient, tic101: Body
) -> None:
    address = f"/v1/loops/{tic101['id']}"
    client.patch(address, json={"form": "parallel"}, headers={"If-Match": '"1"'})
    settings = {"form": "parallel", "Kp": 0.0, "Ki": 0.1, "anti_windup": "clamping"}

    answer = anna.post(f"{address}/sheets", json={"settings": settings, "reason": "integral only"})

    assert answer.status_code == 422
    assert answer.json()["type"] == "/problems/conversion-refused"


def test_what_is_linked_must_be_the_loops_own_and_carry_a_process(
    client: TestClient, sessions: sessionmaker[Session], tic101: Body, model_id: str
) -> None:
    other = client.post("/v1/loops", json=_loop("TIC-102")).json()
    shared = {"loop_id": UUID(tic101["id"]), "reasons": [], "body": {}, "author": "Anna"}
    refused = ModelRow(kind=None, parameters=None, verdict="refused", **shared)
    strange = ModelRow(kind="Relay", parameters={"Ku": 1.0}, verdict="trusted", **shared)
    with sessions.begin() as session:
        session.add_all([refused, strange])
        session.flush()
        tuning = TuningRow(
            loop_id=UUID(tic101["id"]),
            model_id=refused.id,
            process=None,
            profile="general",
            body={},
            recommended=None,
            recommended_reason="none passes",
            author="Anna",
        )
        session.add(tuning)

    def answer(loop: Body, **links: object) -> tuple[int, str]:
        body = {"settings": ISA, "reason": "linked"} | links
        found = client.post(f"/v1/loops/{loop['id']}/sheets", json=body)
        return found.status_code, found.json()["type"]

    none = "00000000-0000-0000-0000-000000000000"
    assert answer(other, model_id=model_id) == (404, "/problems/not-found")
    assert answer(tic101, tuning_id=none) == (404, "/problems/not-found")
    assert answer(tic101, model_id=str(refused.id)) == (422, "/problems/no-process")
    assert answer(tic101, model_id=str(strange.id)) == (422, "/problems/no-process")
    assert answer(tic101, tuning_id=str(tuning.id)) == (422, "/problems/no-process")
    assert answer(tic101, tuning_id=str(tuning.id), model_id=model_id) == (
        422,
        "/problems/invalid-request",
    )
    proposal = f"/v1/loops/{tic101['id']}/sheets/proposal"
    assert client.get(proposal, params={"tuning_id": str(tuning.id)}).status_code == 404


def test_an_approved_sheet_supersedes_the_one_before(
    anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    address = f"/v1/loops/{tic101['id']}/sheets"
    first, second = draft(anna, tic101), draft(anna, tic101, reason="second thoughts")
    assert berta.get(f"{address}/current").status_code == 404

    assert decide(berta, tic101, 1, "approve").json()["status"] == "approved"
    assert berta.get(f"{address}/current").json()["version"] == 1
    approved = decide(berta, tic101, 2, "approve")

    assert approved.json()["decision"]["author"] == "Berta"
    assert approved.headers["etag"] == '"2.approved.2"'
    assert berta.get(f"{address}/current").json()["version"] == 2
    assert statuses(anna, tic101) == {1: "superseded", 2: "approved"}
    unchanged = berta.get(f"{address}/1").json()
    for name in ("settings", "block", "author", "reason", "created_at", "profile"):
        assert unchanged[name] == first[name]
    assert second["created_at"] >= first["created_at"]


def test_each_decision_leaves_one_line_in_the_trail(
    client: TestClient, anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    for _ in range(4):
        draft(anna, tic101)
    before = client.get("/v1/audit/verify").json()["rows"]
    decide(berta, tic101, 1, "approve")
    decide(berta, tic101, 2, "approve")
    decide(berta, tic101, 3, "reject")
    decide(anna, tic101, 4, "withdraw")

    lines = client.get("/v1/audit", params={"loop_id": tic101["id"]}).json()["items"]
    assert client.get("/v1/audit/verify").json()["rows"] == before + 4
    assert [(line["action"], line["actor"]) for line in lines[:4]] == [
        ("sheet.withdrawn", "Anna"),
        ("sheet.rejected", "Berta"),
        ("sheet.approved", "Berta"),
        ("sheet.approved", "Berta"),
    ]
    assert lines[2]["subject"] == f"loops/{tic101['id']}/sheets/2"
    assert lines[2]["before"] == {"status": "draft", "version_in_force": 1}
    assert lines[2]["after"] == {
        "status": "approved",
        "version_in_force": 2,
        "reason": "it is so",
    }


def test_who_wrote_a_draft_may_not_approve_it(
    client_as: Callable[..., TestClient], tic101: Body
) -> None:
    berta = client_as("approver", owner="Berta")
    draft(berta, tic101)

    for same_person in (berta, client_as("admin", owner="BERTA")):
        answer = decide(same_person, tic101, 1, "approve")
        assert answer.status_code == 403
        assert answer.json()["type"] == "/problems/self-approval"
        assert answer.json()["author"] == "Berta"
    assert statuses(berta, tic101) == {1: "draft"}
    assert decide(client_as("approver", owner="Anna"), tic101, 1, "approve").status_code == 200


@on_sqlite
def test_a_site_may_allow_self_approval(
    held: Database, settings: Settings, tic101: Body, berta: TestClient
) -> None:
    app = create_app(settings.model_copy(update={"allow_self_approval": True}), held)
    alone = TestClient(app, headers={"Authorization": berta.headers["Authorization"]})
    draft(alone, tic101)

    assert decide(alone, tic101, 1, "approve").status_code == 200


@on_sqlite
def test_an_engineer_neither_approves_nor_rejects(anna: TestClient, tic101: Body) -> None:
    draft(anna, tic101)

    assert decide(anna, tic101, 1, "approve").status_code == 403
    assert decide(anna, tic101, 1, "reject").status_code == 403


def test_only_the_author_or_an_admin_withdraws(
    client_as: Callable[..., TestClient], anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    draft(anna, tic101)
    draft(anna, tic101)

    refused = decide(berta, tic101, 1, "withdraw")

    assert refused.status_code == 403
    assert refused.json()["type"] == "/problems/not-the-author"
    assert decide(anna, tic101, 1, "withdraw").json()["status"] == "withdrawn"
    assert decide(client_as("admin"), tic101, 2, "withdraw").json()["status"] == "withdrawn"


@pytest.mark.parametrize("first", ["approve", "reject", "withdraw"])
def test_a_version_gets_one_decision(
    anna: TestClient, berta: TestClient, tic101: Body, first: str
) -> None:
    draft(anna, tic101)
    status = decide(anna if first == "withdraw" else berta, tic101, 1, first).json()["status"]

    for second, client in (("approve", berta), ("reject", berta), ("withdraw", anna)):
        answer = decide(client, tic101, 1, second)
        assert answer.status_code == 409
        assert answer.json()["type"] == "/problems/sheet-decided"
        assert answer.json()["sheet_status"] == status


def test_an_approval_needs_the_state_it_was_decided_on(
    anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    """Approving version 2 while looking at nothing in force must not undo an approval of 1."""
    draft(anna, tic101)
    draft(anna, tic101)
    address = f"/v1/loops/{tic101['id']}/sheets/2"
    seen = berta.get(address).headers["etag"]
    decide(berta, tic101, 1, "approve")

    stale = decide(berta, tic101, 2, "approve", seen)
    missing = berta.post(f"{address}/approve", json={"reason": "it is so"})

    assert stale.status_code == 412
    assert stale.json()["current"] == '"2.draft.1"'
    assert missing.status_code == 428
    assert statuses(berta, tic101) == {1: "approved", 2: "draft"}
    assert decide(berta, tic101, 2, "approve").status_code == 200


def test_a_draft_for_another_block_is_not_approved(
    client: TestClient, anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    draft(anna, tic101)
    address = f"/v1/loops/{tic101['id']}"
    client.patch(address, json={"time_unit": "min", "area": "A2"}, headers={"If-Match": '"1"'})

    answer = decide(berta, tic101, 1, "approve")

    assert answer.status_code == 409
    assert answer.json()["type"] == "/problems/block-changed"
    assert answer.json()["fields"] == ["time_unit"]
    client.patch(address, json={"time_unit": "s"}, headers={"If-Match": '"2"'})
    assert decide(berta, tic101, 1, "approve").status_code == 200


def test_of_many_approvals_at_once_one_wins(
    anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    for _ in range(6):
        draft(anna, tic101)

    with ThreadPoolExecutor(6) as pool:
        answers = list(
            pool.map(
                lambda n: decide(berta, tic101, n, "approve", f'"{n}.draft.0"').status_code,
                range(1, 7),
            )
        )

    assert sorted(answers) == [200, 412, 412, 412, 412, 412]
    assert sorted(statuses(berta, tic101).values()) == ["approved"] + ["draft"] * 5
    assert berta.get("/v1/audit/verify").json()["intact"]


def test_of_many_decisions_on_one_draft_one_holds(
    anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    draft(anna, tic101)

    with ThreadPoolExecutor(6) as pool:
        answers = list(
            pool.map(
                lambda what: decide(berta, tic101, 1, what, '"1.draft.0"').status_code,
                ["approve", "reject"] * 3,
            )
        )

    assert sorted(answers) == [200, 412, 412, 412, 412, 412]


def test_drafts_at_once_get_versions_of_their_own(anna: TestClient, tic101: Body) -> None:
    with ThreadPoolExecutor(6) as pool:
        versions = [sheet["version"] for sheet in pool.map(lambda _: draft(anna, tic101), range(6))]

    assert sorted(versions) == [1, 2, 3, 4, 5, 6]


def test_the_database_itself_holds_one_approval_a_number(
    sessions: sessionmaker[Session], anna: TestClient, tic101: Body
) -> None:
    """Even a service without locks could not put two sheets in force."""
    draft(anna, tic101)
    draft(anna, tic101)

    def approve(version: int) -> None:
        with sessions.begin() as session:
            session.add(
                SheetDecisionRow(
                    loop_id=UUID(tic101["id"]),
                    version=version,
                    decision="approved",
                    approval=1,
                    reason="",
                    author="",
                )
            )

    approve(1)
    with pytest.raises(IntegrityError):
        approve(2)


def test_two_versions_are_compared_field_by_field(
    anna: TestClient, tic101: Body, model_id: str
) -> None:
    draft(anna, tic101)
    draft(anna, tic101, settings=ISA | {"Kc": 0.3, "N": None}, model_id=model_id, profile="hvac")
    address = f"/v1/loops/{tic101['id']}/sheets/diff"

    found = anna.get(address, params={"from": 1, "to": 2}).json()
    back = anna.get(address, params={"from": 2, "to": 1}).json()
    same = anna.get(address, params={"from": 2, "to": 2}).json()

    changes = {c["field"]: (c["before"], c["after"]) for c in found["changes"]}
    assert (found["before"], found["after"]) == (1, 2)
    assert changes["settings.Kc"] == (0.45, 0.3)
    assert changes["settings.N"] == (10.0, None)
    assert changes["profile"] == ("general", "hvac")
    assert changes["model_id"] == (None, model_id)
    assert changes["process.tau"] == (None, 120.0)
    assert "settings.Ti" not in changes
    assert {c["field"]: (c["after"], c["before"]) for c in back["changes"]} == changes
    assert same["changes"] == []
    assert anna.get(address, params={"from": 1, "to": 9}).status_code == 404


def test_versions_are_listed_in_pages(anna: TestClient, tic101: Body) -> None:
    for _ in range(5):
        draft(anna, tic101)
    address = f"/v1/loops/{tic101['id']}/sheets"

    first = anna.get(address, params={"limit": 3}).json()
    second = anna.get(address, params={"limit": 3, "cursor": first["next"]}).json()

    assert [sheet["version"] for sheet in first["items"]] == [5, 4, 3]
    assert [sheet["version"] for sheet in second["items"]] == [2, 1]
    assert second["next"] is None
    assert anna.get(f"{address}/99").status_code == 404
    assert anna.get(f"{address}/0").status_code == 422


@pytest.fixture
def tuning_id(sessions: sessionmaker[Session], tic101: Body) -> str:
    """Store a tuning with two entries, as a tuning request writes them."""
    pi = _entry("simc", "PI", Kc=2.0, Ti=120.0, Td=0.0)
    pid = _entry("imc", "PID", Kc=0.45, Ti=135.0, Td=13.3)
    p = _entry("simc", "P", Kc=1.0, Ti=None, Td=0.0, N=None)
    wide = _entry("wide", "PID", Kc=1.0, Ti=20.0, Td=13.3)
    huge = _entry("huge", "PI", Kc=1e9, Ti=120.0, Td=0.0)
    row = TuningRow(
        loop_id=UUID(tic101["id"]),
        process={"kind": "FOPDT", **HEATER},
        profile="general",
        body={"tunings": [pi, p, pid, wide, huge]},
        recommended=pid,
        recommended_reason="passes",
        author="Anna",
    )
    with sessions.begin() as session:
        session.add(row)
    return str(row.id)


def test_a_tuning_is_written_for_the_loops_block_and_can_be_drafted_as_it_is(
    client: TestClient, anna: TestClient, tic101: Body, tuning_id: str
) -> None:
    address = f"/v1/loops/{tic101['id']}"
    client.patch(
        address,
        json={"form": "series", "time_unit": "min", "gain_basis": "percent"},
        headers={"If-Match": '"1"'},
    )

    found = anna.get(f"{address}/sheets/proposal", params={"tuning_id": tuning_id}).json()
    sheet = draft(anna, tic101, settings=found["settings"], tuning_id=tuning_id)

    assert (found["rule"], found["structure"]) == ("imc", "PID")
    assert found["settings"]["form"] == "series"
    assert found["settings"]["Tt"] == pytest.approx(math.sqrt(135 * 13.3) / 60)
    assert found["settings"]["scan_time"] == tic101["sample_time"]
    assert sheet["canonical"]["Kc"] == pytest.approx(0.45)
    assert sheet["canonical"]["Ti"] == pytest.approx(135)
    assert sheet["canonical"]["Td"] == pytest.approx(13.3)
    # The tuning's process, with the loop's scan time of 1 s: half a second more dead time.
    late = margins(FOPDT(K=2.0, tau=120.0, theta=30.5), PID(Kc=0.45, Ti=135.0, Td=13.3))
    assert sheet["evidence"]["margins"]["gain"] == pytest.approx(late.gain)


@on_sqlite
def test_another_entry_of_a_tuning_may_be_chosen(
    client: TestClient, tic101: Body, tuning_id: str
) -> None:
    address = f"/v1/loops/{tic101['id']}/sheets/proposal"

    def proposal(**wanted: str) -> Any:
        return client.get(address, params={"tuning_id": tuning_id, **wanted})

    pi = proposal(rule="simc", structure="PI").json()["settings"]
    p = proposal(structure="P").json()["settings"]

    assert (pi["Kc"], pi["Ti"], pi["Tt"]) == (2.0, 120.0, 120.0)
    assert (p["Ti"], p["anti_windup"], p["Tt"]) == (None, "none", None)
    assert proposal(rule="nobody").status_code == 404
    assert client.get(address, params={"tuning_id": tic101["id"]}).status_code == 404


@on_sqlite
def test_a_tuning_that_the_block_cannot_run_is_refused(
    client: TestClient, tic101: Body, tuning_id: str
) -> None:
    address = f"/v1/loops/{tic101['id']}"
    params = {"tuning_id": tuning_id, "rule": "wide"}
    client.patch(address, json={"form": "series"}, headers={"If-Match": '"1"'})
    no_series = client.get(f"{address}/sheets/proposal", params=params)
    client.patch(address, json={"form": "isa", "action": "direct"}, headers={"If-Match": '"2"'})
    other_way = client.get(f"{address}/sheets/proposal", params=params)

    client.patch(
        address,
        json={"action": "reverse", "gain_basis": "percent", "pv_low": -1e6},
        headers={"If-Match": '"3"'},
    )
    beyond = client.get(f"{address}/sheets/proposal", params=params | {"rule": "huge"})

    assert beyond.status_code == 422
    assert "beyond what a sheet can hold" in beyond.json()["errors"][0]["detail"]
    assert no_series.json()["type"] == "/problems/conversion-refused"
    assert other_way.status_code == 422
    assert "reverse acting" in other_way.json()["errors"][0]["detail"]


@on_sqlite
def test_every_profile_of_the_catalogue_can_be_asked_for(
    anna: TestClient, tic101: Body, model_id: str
) -> None:
    for name, profile in PROFILES.items():
        sheet = draft(anna, tic101, model_id=model_id, profile=name)
        verdict = verify(FOPDT(**HEATER), PID(Kc=0.45, Ti=135.0, Td=13.3), profile)
        assert sheet["evidence"]["passes"] == verdict.passes


def test_rows_of_sheets_are_never_touched_by_the_service(
    sessions: sessionmaker[Session], anna: TestClient, berta: TestClient, tic101: Body
) -> None:
    """The triggers would refuse it; this shows that the service does not even try."""
    draft(anna, tic101)
    with sessions() as session:
        before = vars(session.get_one(SheetRow, (UUID(tic101["id"]), 1))).copy()
    decide(berta, tic101, 1, "approve")
    draft(anna, tic101)
    decide(berta, tic101, 2, "approve")
    with sessions() as session:
        after = vars(session.get_one(SheetRow, (UUID(tic101["id"]), 1))).copy()

    del before["_sa_instance_state"], after["_sa_instance_state"]
    assert after == before


def _entry(rule: str, structure: str, **settings: float | None) -> Body:
    shared = {"form": "ISA", "action": "reverse", "N": 10.0, "b": 1.0, "c": 0.0, "tauF": 0.0}
    return {"rule": rule, "structure": structure, **shared, **settings}


def _loop(tag: str) -> Body:
    return {
        "tag": tag,
        "pv_low": 0.0,
        "pv_high": 100.0,
        "pv_unit": "degC",
        "action": "reverse",
        "form": "isa",
        "time_unit": "s",
        "gain_basis": "eu",
    }
