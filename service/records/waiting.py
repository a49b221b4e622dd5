"""Where uploads wait: a folder each, locked until its request is answered.

A process that is killed cannot clean up, and what it received may be large. Its locks are gone with
it, so whoever receives the next upload finds its folders free and removes them.
"""

import contextlib
import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

if sys.platform != "win32":
    import fcntl

JUST_MADE = 60.0  # s in which a folder may not have its lock yet
DEAD_AFTER = 6 * 3600.0  # s without a write; for notes, and where there are no locks


def uploads_folder(data: Path) -> Path:
    """Find the folder in which uploads wait, and remove what killed processes left there."""
    folder = data / "uploads"
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process answers its request now
            if _is_abandoned(path):
                _remove(path)
    return folder


@contextmanager
def own_folder(uploads: Path) -> Iterator[Path]:
    """Make a folder for one upload that goes away at the end, however that comes."""
    folder = uploads / str(uuid4())
    folder.mkdir()
    lock = _lock(folder)
    try:
        yield folder
    finally:
        _remove(folder)
        if lock is not None:
            os.close(lock)


def _is_abandoned(path: Path) -> bool:
    age = time.time() - path.stat().st_mtime
    if age > JUST_MADE and path.is_dir():
        lock = _lock(path)
        if lock is not None:
            os.close(lock)
            return True
        return sys.platform == "win32" and age > DEAD_AFTER
    return age > DEAD_AFTER


def _lock(folder: Path) -> int | None:
    """Take the lock of a folder, unless somebody has it."""
    if sys.platform == "win32":
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
