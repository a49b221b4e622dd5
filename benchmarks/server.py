"""A Loopwright server of its own for a benchmark, and what it takes of memory."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx2

START_WITHIN = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Server:
    """A running server.

    Attributes
    ----------
    client : httpx2.Client
        Client with an engineer's key, connections kept open.
    pid : int
        Process of the server.
    """

    client: httpx2.Client
    pid: int

    def peak_memory(self) -> float:
        """Largest resident memory of the server so far, with that of its children. [bytes]"""
        return sum(_status(pid, "VmHWM") for pid in _family(self.pid))

    def processor_time(self) -> float:
        """Processor time that the server took so far, without that of its children. [s]"""
        fields = Path(f"/proc/{self.pid}/stat").read_text(encoding="ascii").rpartition(")")[2]
        user, system = fields.split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def memory(self) -> float:
        """Resident memory of the server now, with that of its children. [bytes]"""
        return sum(_status(pid, "VmRSS") for pid in _family(self.pid))


def _status(pid: int, key: str) -> float:
    text = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return float(next(line.split()[1] for line in text.splitlines() if line.startswith(key))) * 1024


def _family(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [pid, *(int(child) for child in children)]


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _command(*words: str) -> list[str]:
    return [str(Path(sys.executable).with_name("loopwright")), *words]


@contextmanager
def server(folder: Path) -> Iterator[Server]:
    """Run a server on a free port over an empty folder, and stop it at the end.

    Parameters
    ----------
    folder : Path
        Its database and sample store.

    Raises
    ------
    TimeoutError
        It does not answer within half a minute.
    """
    port = _free_port()
    data = ["--data", str(folder)]
    subprocess.run(_command("migrate", *data), stdout=subprocess.DEVNULL, check=True)
    create = _command("key", "create", "--owner", "bench", "--role", "engineer", *data)
    token = subprocess.run(create, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()
    with (folder / "server.log").open("wb") as log:
        process = subprocess.Popen(
            _command("serve", "--port", str(port), *data), stdout=log, stderr=subprocess.STDOUT
        )
        try:
            with httpx2.Client(
                base_url=f"http://127.0.0.1:{port}",
                headers={"Authorization": f"Bearer {token}"},
                timeout=300.0,
            ) as client:
                _wait(client, process)
                yield Server(client=client, pid=process.pid)
        finally:
            process.terminate()
            process.wait(timeout=20)


def _wait(client: httpx2.Client, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + START_WITHIN
    while time.monotonic() < deadline and process.poll() is None:
        try:
            if client.get("/health").status_code == httpx2.codes.OK:
                return
        except httpx2.TransportError:
            time.sleep(0.1)
    raise TimeoutError("the server does not answer")
