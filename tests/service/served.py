"""The real service in a process of its own, to be killed at any instant and started again.

Python takes seconds to import everything, so run as a program this file is the parent of the
services: it has everything imported and forks one for every line on stdin. A line is JSON, as is
the answer to it: `{"settings": {...}, "log": FILE}` starts a service and answers its process and
port, `{"process": PID, "signal": 9}` ends one and answers once it is gone.
"""

import json
import os
import selectors
import signal
import subprocess
import sys
import threading
import traceback
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NoReturn, Self

from service.cli.serving import answer, listening
from service.logs import configure_logging
from service.settings import Settings

ROOT = Path(__file__).parents[2]
LONGEST_WAIT = 120.0  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class Running:
    """A service that listens."""

    process: int
    port: int

    @property
    def address(self) -> str:
        """Address for clients."""
        return f"http://127.0.0.1:{self.port}"


class Services:
    """Starts and ends services that write to one log; what still runs at the end is killed."""

    def __init__(self, log: Path) -> None:
        self._log = log
        self._turn = threading.Lock()

    def __enter__(self) -> Self:
        self._parent = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._parent.communicate(timeout=LONGEST_WAIT)

    def start(self, settings: Settings) -> Running:
        """Start a service on any free port; requests wait there until it can answer."""
        stated = settings.model_dump(mode="json", exclude_unset=True) | {"port": 0}
        told = self._ask(settings=stated, log=str(self._log))
        return Running(process=told["process"], port=told["port"])

    def kill(self, running: Running) -> None:
        """Kill a service with -9."""
        self._ask(process=running.process, signal=int(signal.SIGKILL))

    def stop(self, running: Running) -> None:
        """Ask a service to stop."""
        self._ask(process=running.process, signal=int(signal.SIGTERM))

    def logged(self, *, level: str) -> list[dict[str, Any]]:
        """Read what all services so far have logged at a level."""
        lines = self._log.read_text("utf-8").splitlines()
        events = [json.loads(line) for line in lines if line.endswith("}")]  # the last may be cut
        return [event for event in events if event["level"] == level]

    def _ask(self, **order: object) -> dict[str, Any]:
        assert self._parent.stdin is not None
        assert self._parent.stdout is not None
        with self._turn, selectors.DefaultSelector() as waiting:
            self._parent.stdin.write(f"{json.dumps(order)}\n")
            self._parent.stdin.flush()
            waiting.register(self._parent.stdout, selectors.EVENT_READ)
            assert waiting.select(LONGEST_WAIT), f"no answer to {order}"
            line = self._parent.stdout.readline()
        assert line, "the parent of the services has died"
        told: dict[str, Any] = json.loads(line)
        assert "failed" not in told, told["failed"]
        return told


def be_the_service(settings: Settings, log: Path) -> None:
    """Answer until a signal ends it."""
    with log.open("ab") as file:
        os.dup2(file.fileno(), sys.stderr.fileno())
    configure_logging(as_json=True)
    with listening(settings) as taken:
        tell(process=os.getpid(), port=taken.getsockname()[1])
        answer(settings, taken)


def tell(**news: object) -> None:
    sys.stdout.write(f"{json.dumps(news)}\n")
    sys.stdout.flush()


def fork_services() -> None:
    import_everything()
    started: set[int] = set()
    try:
        for line in sys.stdin:
            order = json.loads(line)
            if "signal" in order:
                os.kill(order["process"], order["signal"])
                os.waitpid(order["process"], 0)
                started.remove(order["process"])
                tell(ended=order["process"])
                continue
            child = os.fork()
            if child == 0:
                never_come_back(order)
            started.add(child)
    finally:
        for process in started:
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)


def import_everything() -> None:
    """Import what a service imports only once it runs, and at its first upload."""
    import pandas  # noqa: F401
    import pyarrow.pandas_compat  # noqa: F401
    import uvicorn.protocols.http.h11_impl  # noqa: F401
    from sqlalchemy.orm import configure_mappers

    from service.app import create_app

    configure_mappers()
    create_app(Settings(data=Path("nowhere"))).openapi()  # nothing connects before it starts


def never_come_back(order: dict[str, Any]) -> NoReturn:
    """Run the service in a fork, which must not return into the parent's code."""
    try:
        os.close(sys.stdin.fileno())
        be_the_service(Settings.model_validate(order["settings"]), Path(order["log"]))
    except BaseException:  # noqa: BLE001 - see above
        tell(failed=traceback.format_exc())
        os._exit(1)
    os._exit(0)


if __name__ == "__main__":
    fork_services()
