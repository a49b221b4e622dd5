import math
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from advice.model_export import TARGETS, export_model
from loop.open_loop import step_response
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction

PROCESSES: list[Process] = [
    FOPDT(K=-2.1, tau=120, theta=30),
    SOPDT(K=2, tau1=30, tau2=7, theta=11),
    IPDT(K=0.03, theta=4.25),
    DoubleIntegrator(K=0.5, theta=0),
    TransferFunction((-1.0, 0.5), (1.0, 0.4, 1.0), 1.3),
]


def run(text: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(compile(text, "script", "exec"), names)  # noqa: S102 - the script is the result
    return names


@pytest.mark.parametrize("process", PROCESSES)
def test_the_plain_python_script_answers_a_step_as_we_do(process: Process) -> None:
    names = run(export_model(process, "python").text)
    t = np.linspace(0.0, 200.0, 400)
    ours = step_response(process, t)

    np.testing.assert_allclose(
        names["step_response"](t), ours, rtol=0, atol=2e-5 * np.max(np.abs(ours))
    )
    gain = run(export_model(TransferFunction((3.0,), (2.0,), 5.0), "python").text)
    np.testing.assert_allclose(gain["step_response"](np.array([0.0, 4.0, 6.0])), [0, 0, 1.5])


@pytest.mark.parametrize("process", PROCESSES)
def test_the_python_control_script_has_the_same_response_to_its_pade_error(
    process: Process,
) -> None:
    text = export_model(process, "python-control").text
    system = run(text)["process"]
    w = 1.0 / (process.theta or 10.0)
    s = 1j * w
    G = np.polyval(process.numerator, s) / np.polyval(process.denominator, s)

    assert ("Padé" in text) == (process.theta > 0)
    assert isinstance(system, control.TransferFunction)
    assert system(s) == pytest.approx(G * np.exp(-s * process.theta), rel=1e-8)


@pytest.mark.parametrize("process", PROCESSES)
@pytest.mark.parametrize("target", ["gekko", "do-mpc"])
def test_the_sampled_models_are_exact_at_their_samples(target: str, process: Process) -> None:
    # The part of the script that needs no other tool: its numbers, run as they are printed.
    text = export_model(process, target, sample_time=0.8).text
    numbers = text[text.index("h = ") : text.index("q = ")] + re.findall("q = .*\n", text)[0]
    m = run("import numpy as np\n" + numbers)
    x, ys = np.zeros(len(m["early"])), []
    op = [0.0] * (m["q"] + 1) + [1.0] * 150
    for k in range(150):
        older, newer = op[k], op[k + 1]
        ys.append(m["C"] @ x + m["D"] * older)
        x = m["A"] @ x + m["late"] * older + m["early"] * newer

    ours = step_response(process, 0.8 * np.arange(150))
    np.testing.assert_allclose(ys, ours, rtol=0, atol=1e-9 * np.max(np.abs(ours)))


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed here")
def test_the_matlab_script_answers_in_octave_as_we_do(tmp_path: Path) -> None:
    """Frequency response to the error of its Padé approximation, and a step twenty delays on."""
    asked = []
    for process in PROCESSES:
        late = process.theta or 1.0
        asked.append(
            export_model(process, "matlab").text.replace(
                "step(G)\n",
                f"[mag, ph] = bode(G, {1 / late!r}); [y, t] = step(G, {20 * late!r});\n"
                "printf('%.15g ', mag, ph, t(end), y(end));\n",
            )
        )
    file = tmp_path / "all.m"
    file.write_text("\n".join(asked))
    done = subprocess.run(
        ["octave-cli", "--norc", str(file)], capture_output=True, text=True, timeout=60
    )
    rows = np.array(done.stdout.split(), dtype=float).reshape(-1, 4)
    for process, (mag, phase, t, y) in zip(PROCESSES, rows.tolist(), strict=True):
        s = 1j / (process.theta or 1.0)
        G = np.polyval(process.numerator, s) / np.polyval(process.denominator, s)
        G *= np.exp(-s * process.theta)
        assert mag * np.exp(1j * math.radians(phase)) == pytest.approx(G, rel=2e-10)
        assert y == pytest.approx(step_response(process, np.array([0.0, t]))[-1], rel=1e-6)


@pytest.mark.parametrize("process", PROCESSES)
@pytest.mark.parametrize("target", ["matlab", "julia", "modelica"])
def test_the_other_scripts_carry_every_number_in_full(target: str, process: Process) -> None:
    script = export_model(process, target)
    found = set(map(float, re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", script.text)))

    assert {*process.numerator, *process.denominator} <= found
    assert not process.theta or process.theta in found
    assert script.file_name == TARGETS[target][0]
    waits = {"matlab": "InputDelay", "julia": "delay(theta)", "modelica": "FixedDelay"}[target]
    assert (waits in script.text) == (process.theta > 0)


def test_what_cannot_be_written_is_refused_in_words() -> None:
    heater = PROCESSES[0]
    with pytest.raises(ValueError, match="target must be one of python, python-control"):
        export_model(heater, "abacus")
    with pytest.raises(ValueError, match="the sample time must be positive, got 0"):
        export_model(heater, "gekko", sample_time=0)
    with pytest.raises(ValueError, match=r"is 3e\+04 samples of 0.001 s; 1000 is the most"):
        export_model(heater, "gekko", sample_time=1e-3)
    assert "h = 1.0 " in export_model(TransferFunction((3.0,), (2.0,)), "gekko").text
