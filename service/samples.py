"""The sample store as the application holds it: opened once, beside the database."""

from datetime import datetime
from threading import Lock
from typing import Annotated, TypeAlias

from fastapi import Depends, Request

from historian.sample_store import SampleStore
from historian.samples import Samples as LoopSamples
from loop.errors import NoSamples
from service.settings import Settings
from service.tables import LoopRow

_OPENING = Lock()


def open_samples(settings: Settings) -> SampleStore:
    """Open the installation's sample store; its folder is made if it is not there."""
    return SampleStore(settings.data / "samples")


def samples_of(store: SampleStore, loop: LoopRow, start: datetime, end: datetime) -> LoopSamples:
    """Read a loop's samples from an instant up to another.

    Raises
    ------
    NoSamples
        There are none; the loop is named by its tag, and not by the store's name of it.
    """
    try:
        found = store.read(loop.id, start, end)
    except NoSamples:
        raise NoSamples(loop.tag) from None
    if not len(found):
        raise NoSamples(loop.tag)
    return found


def sample_store(request: Request) -> SampleStore:
    """Find the application's sample store, opening it at its first use."""
    state = request.app.state
    with _OPENING:
        held = getattr(state, "samples", None)
        if not isinstance(held, SampleStore):
            held = open_samples(state.settings)
            state.samples = held
    return held


Samples: TypeAlias = Annotated[SampleStore, Depends(sample_store)]
