"""Listening on an address, and answering there until told to stop."""

import contextlib
import os
import signal
import socket

import uvicorn

from service.app import create_app
from service.errors import ServiceError
from service.settings import Settings
from service.work import working

# An answer that takes longer than this when the service is told to stop is cut off.
LONGEST_GOODBYE = 10  # s


class AddressTaken(ValueError):
    """Nobody can listen on the address."""

    def __init__(self, settings: Settings, reason: str) -> None:
        super().__init__(
            f"Cannot listen on {settings.host} port {settings.port}: {reason}. "
            "Choose another port with --port."
        )


def listening(settings: Settings) -> socket.socket:
    """Take the address, so that nobody else can, before any work is done for it.

    Raises
    ------
    AddressTaken
        Another program listens there, or it is no address of this machine.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # With the protocol named asyncio sends at once; else the end of an answer may wait 40 ms
        # for the other side to confirm what came before.
        taken = socket.socket(family, kind, protocol)
    except OSError as error:
        raise AddressTaken(settings, error.strerror or str(error)) from error
    try:
        if os.name == "posix":  # a restart need not wait for connections of the run before
            taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(address)
        taken.listen(2048)
    except OSError as error:
        taken.close()
        raise AddressTaken(settings, error.strerror or str(error)) from error
    return taken


def address_of(taken: socket.socket) -> str:
    """Write the address that browsers and programs use."""
    host, port = taken.getsockname()[:2]
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 - it is compared
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def answer(settings: Settings, taken: socket.socket) -> None:
    """Run the service on an address until SIGTERM or Ctrl-C, and let running requests finish.

    Raises
    ------
    ServiceError
        The service did not start.
    """
    server = uvicorn.Server(
        uvicorn.Config(
            create_app(settings),
            log_config=None,  # ours: one format, no query strings, no secrets
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=LONGEST_GOODBYE,
        )
    )
    # The server passes the signal on once it has stopped; that is no failure.
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        with contextlib.suppress(KeyboardInterrupt), working(settings):
            server.run(sockets=[taken])
    except SystemExit as end:
        raise ServiceError("The service did not start; the log says why.") from end
    finally:
        signal.signal(signal.SIGTERM, before)
