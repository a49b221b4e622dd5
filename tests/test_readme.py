"""The README and the tutorial, typed as printed: in their order, against a service of their own."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from service.actors import Role
from service.database import Database
from service.keys.actions import create_key
from service.settings import Settings

ROOT = Path(__file__).parent.parent
SCRIPTS = Path(sys.executable).parent
PATIENCE = 180.0  # s, of a machine that does much else
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorial").glob("*.md"))]
# As printed, a refused request prints its problem document and goes on; here it ends the script.
STRICT = """set -euo pipefail
curl() { command curl --fail-with-body "$@"; }
"""


@dataclass(frozen=True)
class Service:
    address: str
    token: str


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A folder that looks like the project's, where files may be left."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    return tmp_path


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    data, log = tmp_path / "loopwright-data", tmp_path / "service.log"
    with log.open("w") as stderr:
        process = subprocess.Popen(
            [str(SCRIPTS / "loopwright"), "serve", "--port", "0", "--data", str(data)],
            stderr=stderr,
            env=environment(),
        )
    try:
        address = listening(process, log)
        held = Database.at(Settings(data=data).url)
        with held.sessions.begin() as session:
            _, token = create_key(session, owner="demo", role=Role.ADMIN)
        held.engine.dispose()
        yield Service(address, token)
    finally:
        process.terminate()
        process.wait(PATIENCE)


def listening(process: subprocess.Popen[bytes], log: Path) -> str:
    """Wait until the service has said where it listens."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and process.poll() is None:
        for line in log.read_text("utf-8").splitlines(keepends=True):
            if '"event": "listening"' in line and line.endswith("\n"):
                return str(json.loads(line)["address"])
        time.sleep(0.05)
    raise AssertionError(f"the service did not start: {log.read_text('utf-8')}")


def environment() -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if not k.startswith("LOOPWRIGHT_")}
    return kept | {"PATH": f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}"}


def test_every_page_has_something_to_run() -> None:
    for page in PAGES:
        assert blocks(page, "sh"), page
    assert blocks(ROOT / "README.md", "python")


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed here")
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed here")
def test_every_shell_line_of_the_readme_and_the_tutorial_runs(desk: Path, service: Service) -> None:
    text = "\n".join(line for page in PAGES for line in blocks(page, "sh"))
    assert "LOOPWRIGHT_KEY=lw_..." in text
    assert "http://127.0.0.1:8000/" in text
    script = text.replace("lw_...", service.token).replace("http://127.0.0.1:8000", service.address)

    done = subprocess.run(
        ["bash", "-c", STRICT + script],
        cwd=desk,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )

    assert done.returncode == 0, f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    assert (desk / "report.html").read_text("utf-8").lstrip().lower().startswith("<!doctype html")
    said = done.stdout.splitlines()
    assert "approved" in said
    assert "True" in said
    assert said[-2].startswith("The chain is intact: ")
    assert said[-1].startswith("The known head is row ")
    # The whole way from the file to the sheet in force: the model is the simulated heater.
    shown = done.stdout[done.stdout.index('"version": 1') :]
    K, tau, theta = (
        float(re.findall(rf'"{name}": ([\d.]+)', shown)[0]) for name in ("K", "tau", "theta")
    )
    assert pytest.approx(2.0, rel=0.01) == K
    assert tau == pytest.approx(120.0, rel=0.01)
    assert theta == pytest.approx(30.0, rel=0.02)
    assert '"passes": true' in shown


def test_every_python_block_of_the_readme_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    for page in PAGES:
        for block in blocks(page, "python"):
            exec(compile(block, str(page), "exec"), {})  # noqa: S102 - that is the test

    assert "FOPDT(K=2.0" in capsys.readouterr().out


def test_links_of_the_pages_lead_somewhere() -> None:
    for page in [*PAGES, *ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text("utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_tutorial_file_is_what_its_script_writes(tmp_path: Path) -> None:
    folder = ROOT / "docs" / "tutorial"
    script = tmp_path / "make_heater_step.py"
    shutil.copy(folder / "make_heater_step.py", script)
    runpy.run_path(str(script), run_name="__main__")
    assert (tmp_path / "heater-step.csv").read_bytes() == (folder / "heater-step.csv").read_bytes()
