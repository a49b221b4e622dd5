"""What a killed process or a power cut leaves in the folder, and how it is put right.

A kill leaves staging files: of Delta, whose names end in `#` and a number and which its vacuum does
not know, and of our own in the folder `_staging`.
A power cut can leave the newest log entry or checkpoint torn, because Delta does not fsync them. No
upload was answered on the strength of such an entry, so it is set aside, never deleted.
"""

import contextlib
import json
import re
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

WAITING = "_staging"
STAGING = re.compile(r"#\d+$")
ENTRY = re.compile(r"\d{20}\.json$")


def sweep_staging(folder: Path, *, older_than: float) -> int:
    """Remove staging files that no writer has touched for a while.

    Parameters
    ----------
    folder : Path
        Folder of the table.
    older_than : float
        Age from which the writer counts as dead. [s]

    Returns
    -------
    int
        Number of files removed.
    """
    dead = time.time() - older_than
    swept = 0
    waiting = (path for path in (folder / WAITING).rglob("*") if path.is_file())
    staged = (path for path in folder.rglob("*#*") if STAGING.search(path.name))
    for path in [*waiting, *staged]:
        # its writer may finish, or another process sweep it, at this moment
        with contextlib.suppress(FileNotFoundError):
            if path.stat().st_mtime <= dead:
                path.unlink()
                swept += 1
    return swept


def set_aside_torn_entries(log_folder: Path) -> list[str]:
    """Rename a torn newest log entry and torn checkpoints, so that the table opens without them.

    Returns
    -------
    list of str
        Names of the files set aside; they now end in `.torn`.
    """
    torn = [path for path in log_folder.glob("*.checkpoint*.parquet") if not _is_parquet(path)]
    entries = sorted(path for path in log_folder.iterdir() if ENTRY.match(path.name))
    if entries and not _is_whole(entries[-1]):
        torn.append(entries[-1])
    for path in torn:
        path.rename(path.with_name(f"{path.name}.torn"))
    hint = log_folder / "_last_checkpoint"
    if hint.exists() and not _points_somewhere(hint):
        torn.append(hint)
        hint.rename(hint.with_name("_last_checkpoint.torn"))
    return [path.name for path in torn]


def _is_parquet(path: Path) -> bool:
    try:
        pq.read_metadata(path)
    except (pa.ArrowInvalid, OSError):
        return False
    return True


def _is_whole(entry: Path) -> bool:
    try:
        return all(json.loads(line) for line in entry.read_bytes().splitlines())
    except ValueError:
        return False


def _points_somewhere(hint: Path) -> bool:
    try:
        version = int(json.loads(hint.read_bytes())["version"])
    except (ValueError, KeyError, TypeError):
        return False
    return any(hint.parent.glob(f"{version:020d}.checkpoint*.parquet"))
