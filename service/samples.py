"""The sample store as the application holds it: opened once, beside the database."""

from threading import Lock
from typing import Annotated, TypeAlias

from fastapi import Depends, Request

from historian.sample_store import SampleStore
from service.settings import Settings

_OPENING = Lock()


def open_samples(settings: Settings) -> SampleStore:
    """Open the installation's sample store; its folder is made if it is not there."""
    return SampleStore(settings.data / "samples")


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
