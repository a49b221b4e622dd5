"""`loopwright simulate`: the same answer as from a notebook, and refusals in words."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient

from advice.fan import box_draws
from advice.scenario import Conditions, LoadChange, SetPointChange, Transfer
from advice.what_if import what_if
from advice.what_if_body import what_if_body
from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits
from loop.process import FOPDT
from loop.simulation import simulate
from loop.valve import Kano
from service.cli import run

Said = Callable[[], tuple[str, str]]
HEATER = "FOPDT:2,120,30"


def test_it_prints_what_a_notebook_finds(said: Said) -> None:
    call = (
        f"simulate {HEATER} 0.9,135,13.3 --against 0.4,200,0 --step 5 --ramp 0.1 --load -2 "
        "--transfer 1 --scan-time 4 --length 1200 --limits 0,60 --rate 2 --anti-windup tracking "
        "--pv-filter 6 --noise 0.1 --resolution 0.02 --valve Kano:0.4,0.2 --rest 150,40 "
        "--spread 30 --json"
    )
    assert run(call.split()) == 0
    process = FOPDT(K=2, tau=120, theta=30)
    found = what_if(
        process,
        {"new": PID(Kc=0.9, Ti=135, Td=13.3), "against": PID(Kc=0.4, Ti=200)},
        [SetPointChange(size=5, rate=0.1), LoadChange(size=-2), Transfer(size=1)],
        conditions=Conditions(
            scan_time=4,
            t_end=1200,
            limits=OutputLimits(low=0, high=60, rate=2),
            anti_windup=AntiWindup.TRACKING,
            pv_filter=6,
            noise=0.1,
            resolution=0.02,
            valve=Kano(S=0.4, J=0.2),
            pv0=150,
            op0=40,
        ),
        draws=box_draws(process, 0.3),
    )
    assert json.loads(said()[0]) == json.loads(json.dumps(what_if_body(found)))


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_every_condition_of_the_api_has_its_option(
    said: Said, client: TestClient, tmp_path: Path
) -> None:
    ask = (
        "simulate TF:2/100,25,1,3 0.9,30,4,12,1,b=0.6,c=0.5 --load 1 --step 2 --transfer 0.5 "
        "--scan-time 1 --length 200 --limits -5,5 --rate 1 --anti-windup {} --tracking-time 9 "
        "--noise 0.05 --seed 7 --json"
    )
    body = {
        "process": {
            "kind": "TransferFunction",
            "numerator": [2.0],
            "denominator": [100.0, 25.0, 1.0],
            "theta": 3.0,
        },
        "controllers": [
            {"name": "new", "Kc": 0.9, "Ti": 30.0, "Td": 4.0, "N": 12.0, "tauF": 1.0,
             "b": 0.6, "c": 0.5},
        ],
        "events": [
            {"kind": "set point", "size": 2.0},
            {"kind": "load", "size": 1.0},
            {"kind": "transfer", "size": 0.5},
        ],
    }  # fmt: skip
    conditions: dict[str, object] = {
        "scan_time": 1.0, "t_end": 200.0, "low": -5.0, "high": 5.0, "rate": 1.0, "Tt": 9.0,
        "noise": 0.05, "seed": 7,
    }  # fmt: skip
    for mode in AntiWindup:
        conditions["anti_windup"] = mode.value
        answer = client.post("/v1/simulations", json={**body, "conditions": conditions})
        assert answer.status_code == 200, answer.text
        said()  # what the service logged
        call = ask.split()
        call[call.index("{}")] = mode.value
        assert run(call) == 0
        assert json.loads(said()[0]) == answer.json()
        assert answer.json()["events"][2]["runs"][0]["bump"] < 1e-9

    rows = [[2.0, 120.0, 30.0], [2.5, 100.0, 35.0]]
    file = tmp_path / "draws.csv"
    file.write_text("\n".join(",".join(map(str, row)) for row in rows) + "\n\n")
    heater = {
        "process": {"kind": "FOPDT", "K": 2.0, "tau": 120.0, "theta": 30.0},
        "controllers": [{"name": "new", "Kc": 0.9, "Ti": 135.0}],
        "events": [{"kind": "set point", "size": 1.0}],
    }
    for options, fan in (
        (["--draws", str(file)], {"draws": rows}),
        (["--spread", "25", "--count", "9"], {"spread": 0.25, "count": 9}),
    ):
        answer = client.post("/v1/simulations", json={**heater, "fan": fan})
        said()
        assert run(["simulate", HEATER, "0.9,135", *options, "--json"]) == 0
        assert json.loads(said()[0]) == answer.json()
    file.write_text("1,2,3\n1,2\n")
    assert run(["simulate", HEATER, "0.9,135", "--draws", str(file)]) == 2
    assert "as many numbers" in said()[1]
    assert run(["simulate", HEATER, "0.9,135", "--draws", "none.csv"]) == 2
    assert run(["simulate", HEATER, "0.9,135", "--draws", str(file), "--spread", "9"]) == 2
    assert "either --spread or --draws" in said()[1]


def test_a_person_reads_a_table_for_each_event(said: Said) -> None:
    call = f"simulate {HEATER} 0.9,135,13.3 --against 3,60,0 --load 2 --transfer 1 --spread 20"
    assert run([*call.split(), "--length", "90000", "--scan-time", "20"]) == 0
    out, err = said()
    assert err == ""
    for words in ("Load", "Transfer", "peak PV", "bump at the transfer", "over 100 processes"):
        assert words in out
    assert "against: The simulated loop grows without bound" in out


def test_the_noise_is_told_as_travel_a_day(said: Said) -> None:
    assert run(["simulate", HEATER, "0.9,135,13.3", "--noise", "0.1", "--scan-time", "2"]) == 0
    assert "the noise alone moves the output by 38730 OP a day" in said()[0]


def test_without_an_event_the_set_point_moves_by_one(said: Said) -> None:
    assert run(["simulate", HEATER, "0.9,135,13.3"]) == 0
    assert "overshoot %" in said()[0]
    assert run(["simulate", HEATER, "9,100,0", "--length", "90000"]) == 0
    assert "grows without bound" in said()[0]


def test_a_record_is_met_again(tmp_path: Path, said: Said) -> None:
    t = np.arange(400) * 5.0
    load = np.where(t > 500, 3.0, 0.0)
    held = simulate(
        FOPDT(K=2, tau=120, theta=30), PID(Kc=0.4, Ti=200), t_end=t[-1], dt=5, load=load, sp=0.0
    )
    rows = zip(t.tolist(), held.pv.tolist(), held.op.tolist(), strict=True)
    file = tmp_path / "day.csv"
    file.write_text("t [s],PV,OP,SP\n" + "".join(f"{s},{y!r},{u!r},0\n" for s, y, u in rows))
    call = ["simulate", HEATER, "0.9,135,13.3", "--against", "0.4,200,0", "--replay", str(file)]
    assert run(call) == 0
    assert "as recorded" in said()[0]
    assert run([*call, "--json"]) == 0
    event = json.loads(said()[0])["events"][0]
    np.testing.assert_allclose(
        event["runs"][1]["response"]["pv"], event["recorded"]["pv"], atol=1e-9
    )
    assert event["recorded"]["measures"]["IAE"] == pytest.approx(
        event["runs"][1]["measures"]["IAE"]
    )


@pytest.mark.parametrize("valve", ["Choudhury:1,0.5", "he:1,0.5", "DeadBand:1"])
def test_valves_are_stated_by_their_numbers(valve: str, said: Said) -> None:
    assert run(["simulate", HEATER, "0.9,135,0", "--valve", valve, "--json"]) == 0
    name = json.loads(said()[0])["conditions"]["valve"]["model"]
    assert name.lower() == valve.split(":")[0].lower()


@pytest.mark.parametrize(
    ("arguments", "because"),
    [
        ([HEATER], "Missing argument"),
        ([HEATER, "0.9,135,0", "--limits", "3"], "--limits takes two numbers such as 0,100"),
        ([HEATER, "0.9,135,0", "--rest", "a,b"], "--rest takes two numbers"),
        ([HEATER, "0.9,135,0", "--valve", "Foo:1"], "there is no valve 'Foo:1'"),
        ([HEATER, "0.9,135,0", "--valve", "Kano:1,x"], "could not convert"),
        ([HEATER, "0.9,135,0", "--valve", "He:1,2"], "fd must not exceed fs"),
        ([HEATER, "0.9,135,0", "--scan-time", "1e-9"], "Change t_end or scan_time"),
        ([HEATER, "0.9,135,0", "--spread", "100"], "spread must lie between"),
        ([HEATER, "0.9,135,0", "--replay", "nowhere.csv"], "there is no file nowhere.csv"),
        (["TF:1/1,1,1,0", "1", "--spread", "10"], "not a general transfer function"),
    ],
)
def test_wrong_calls_say_what_is_wrong(arguments: list[str], because: str, said: Said) -> None:
    assert run(["simulate", *arguments]) == 2
    out, err = said()
    assert out == ""
    assert because in " ".join(err.split())
