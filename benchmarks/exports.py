"""Historian exports of any size for the CSV benchmark, in the four layouts that plants use most."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

Seconds: TypeAlias = npt.NDArray[np.int64]

BAD_WORDS = ("Bad", "No Data", "I/O Timeout", "Bad Input")
ISO = "%Y-%m-%dT%H:%M:%SZ"
DAY_MONTH = "%d-%b-%y %H:%M:%S"
START = 1_767_225_600  # 2026-01-01 00:00:00 UTC
BAD_SHARE = 0.001
BROKEN_STAMP = "not a time"
# A multiple of the number of tags, so that every block of a long file starts a new second.
BLOCK = 240_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """One shape of an export.

    Attributes
    ----------
    name : str
        As written in the table.
    long : bool
        One value a row (tag, stamp, value) instead of one stamp a row.
    stamps : str
        Format of the time stamps, UTC.
    tags : tuple of str
        Columns, or tags of a long file. They are the signals of whole loops.
    """

    name: str
    long: bool
    stamps: str
    tags: tuple[str, ...]


def _tags(loops: int) -> tuple[str, ...]:
    return tuple(f"FIC-{100 + n}.{signal}" for n in range(loops) for signal in ("PV", "SP", "OP"))


LAYOUTS = {
    "wide_iso": Layout(name="wide, ISO 8601", long=False, stamps=ISO, tags=_tags(4)),
    "wide_dmy": Layout(name="wide, DD-MMM-YY", long=False, stamps=DAY_MONTH, tags=_tags(4)),
    "long_iso": Layout(name="long, ISO 8601", long=True, stamps=ISO, tags=_tags(4)),
    "long_dmy": Layout(name="long, DD-MMM-YY", long=True, stamps=DAY_MONTH, tags=_tags(4)),
}


def _stamps(seconds: Seconds, stamp_format: str, rng: np.random.Generator) -> pa.Array:
    times = pa.array(seconds).cast(pa.timestamp("s"))
    broken = np.arange(seconds.size) == rng.integers(0, seconds.size)
    return pc.if_else(pa.array(broken), BROKEN_STAMP, pc.strftime(times, stamp_format))


def _values(n: int, rng: np.random.Generator) -> pa.Array:
    numbers = np.round(50 + np.cumsum(rng.normal(0, 0.05, n)), 3)
    words = pc.cast(pa.array(numbers), pa.string())
    bad = pa.array(rng.random(n) < BAD_SHARE)
    return pc.if_else(bad, pa.array(rng.choice(BAD_WORDS, n)), words)


def write_export(
    path: Path,
    layout: Layout,
    *,
    size: float = math.inf,
    rows: float = math.inf,
    block: int = BLOCK,
    seed: int = 0,
) -> int:
    """Write an export of about this size: a sample a second, 0.1 % bad words, few broken stamps.

    Parameters
    ----------
    path : Path
        File to write.
    layout : Layout
        Its shape.
    size, rows : float
        Size [bytes] or rows [-] wanted, whichever comes first; the last block may pass it.
    block : int
        Rows written at a time, one broken stamp in each; a multiple of the number of tags. [-]
    seed : int
        Of the random values. [-]

    Returns
    -------
    int
        Number of rows below the header.
    """
    rng = np.random.default_rng(seed)
    tags = layout.tags
    heads = ("tag", "timestamp", "value") if layout.long else ("timestamp", *tags)
    done = 0
    plain = csv.WriteOptions(include_header=False, quoting_style="none")
    with path.open("wb") as file:
        file.write((",".join(heads) + "\n").encode())
        while file.tell() < size and done < rows:
            seconds = START + np.arange(done, done + block, dtype=np.int64)
            columns: list[pa.Array]
            if layout.long:
                seconds = START + (seconds - START) // len(tags)
                names = pa.array(np.resize(np.array(tags), block))
                columns = [names, _stamps(seconds, layout.stamps, rng), _values(block, rng)]
            else:
                stamps = _stamps(seconds, layout.stamps, rng)
                columns = [stamps, *(_values(block, rng) for _ in tags)]
            csv.write_csv(pa.table(columns, names=list(heads)), file, write_options=plain)
            done += block
    return done
