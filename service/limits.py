"""How much one caller may ask, so that nobody takes the service away from the others.

All counts are held here, in memory, by one process: several processes of one installation count
each on its own, and a restart forgets. What keeps strangers out is the length of the keys' secrets;
these limits keep the service answering meanwhile. How: docs/methods/limits.md.
"""

import math
import time
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Callable, Hashable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from ipaddress import IPv6Address, ip_address
from typing import Generic, TypeVar

from fastapi import Depends, Request

from service.actors import Actor
from service.errors import NotAuthenticated, TooManyRequests
from service.settings import Settings

MINUTE = 60.0  # s
# Of the 40 threads that answer requests; the others stay free for what is read and written.
HEAVY_IN_ALL = 32
# Callers that are remembered; the one that was quiet longest is forgotten first.
MOST_REMEMBERED = 10_000
SOON = 1  # s, after which a heavy question may have ended

K = TypeVar("K", bound=Hashable)


class Allowance(Generic[K]):
    """So many requests a minute to each caller, all of them at once if need be.

    Parameters
    ----------
    a_minute : int
        Requests a minute; 0 for no limit.
    clock : callable
        Seconds that only rise. [s]
    """

    def __init__(self, a_minute: int, clock: Callable[[], float]) -> None:
        self._most = float(a_minute)
        self._clock = clock
        self._left: OrderedDict[K, tuple[float, float]] = OrderedDict()

    def take(self, caller: K) -> float:
        """Count a request; where none is left, tell the seconds until one is, otherwise 0."""
        if not self._most:
            return 0.0
        left = self._now(caller)
        if left < 1:
            return (1 - left) * MINUTE / self._most
        self._keep(caller, left - 1)
        return 0.0

    def give_back(self, caller: K) -> None:
        """Do not count a request after all."""
        if self._most:
            self._keep(caller, min(self._now(caller) + 1, self._most))

    def _now(self, caller: K) -> float:
        left, at = self._left.get(caller, (self._most, 0.0))
        return min(left + (self._clock() - at) * self._most / MINUTE, self._most)

    def _keep(self, caller: K, left: float) -> None:
        self._left[caller] = left, self._clock()
        self._left.move_to_end(caller)
        if len(self._left) > MOST_REMEMBERED:
            self._left.popitem(last=False)


class Limits:
    """The limits of one process, asked by its event loop alone.

    Parameters
    ----------
    settings : Settings
        How much is allowed.
    clock : callable
        Seconds that only rise. [s]
    """

    def __init__(self, settings: Settings, clock: Callable[[], float] = time.monotonic) -> None:
        self._heavy: Allowance[str] = Allowance(settings.heavy_per_minute, clock)
        self._tries: Allowance[str] = Allowance(settings.failed_keys_per_minute, clock)
        self._at_once = settings.heavy_at_once
        self._running: Counter[str] = Counter()
        self._known: OrderedDict[bytes, None] = OrderedDict()

    @contextmanager
    def heavy(self, key_id: str) -> Iterator[None]:
        """Let a key ask a heavy question, for as long as it takes.

        Raises
        ------
        TooManyRequests
            The key has as many under way, or asked as many in the last minute, as it may; or all
            keys together have.
        """
        if self._at_once and self._running[key_id] >= self._at_once:
            raise TooManyRequests(
                f"This key has {self._at_once} questions under way, and may have no more.", SOON
            )
        if self._running.total() >= HEAVY_IN_ALL:
            raise TooManyRequests("The service works on as many questions as it can.", SOON)
        wait = self._heavy.take(key_id)
        if wait:
            raise TooManyRequests("This key asked too much in the last minute.", math.ceil(wait))
        self._running[key_id] += 1
        try:
            yield
        finally:
            self._running[key_id] -= 1
            if not self._running[key_id]:
                del self._running[key_id]

    @contextmanager
    def trying(self, token: str, address: str) -> Iterator[None]:
        """Let an address try a key.

        A key that was good before is always let through: who shares an address with a guesser, or
        with a forgotten script, goes on working.

        Raises
        ------
        TooManyRequests
            Too many keys from there were wrong. The key has not been looked at.
        """
        mark, caller = sha256(token.encode()).digest(), _network(address)
        counted = mark not in self._known
        # Counted before it is looked at, so that many at once are no way around the limit.
        wait = self._tries.take(caller) if counted else 0.0
        if wait:
            raise TooManyRequests("Too many wrong keys came from this address.", math.ceil(wait))
        try:
            yield
        except NotAuthenticated:
            if not counted:  # revoked since
                self._known.pop(mark, None)
            raise
        except BaseException:
            if counted:  # the key was not at fault
                self._tries.give_back(caller)
            raise
        if counted:
            self._tries.give_back(caller)
        self._known[mark] = None
        self._known.move_to_end(mark)
        if len(self._known) > MOST_REMEMBERED:
            self._known.popitem(last=False)


def _network(address: str) -> str:
    """Name who is behind an address: of IPv6 everybody has 2^64 of them."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, IPv6Address) and parsed.ipv4_mapped is None:
        return str(IPv6Address(int(parsed) >> 64 << 64))
    return str(parsed)


async def _heavy(request: Request) -> AsyncIterator[None]:
    actor = getattr(request.state, "actor", None)
    limits = request.app.state.limits
    if not isinstance(actor, Actor) or not isinstance(limits, Limits):
        raise NotAuthenticated("There is no API key.")
    with limits.heavy(actor.key_id or actor.owner):
        yield


HEAVY = Depends(_heavy, scope="function")
"""Of an operation that computes much: it counts, from its beginning to its answer."""

HEAVY_TO_THE_END = Depends(_heavy, scope="request")
"""Of an operation that computes while its answer goes out."""
