"""One way to read an export, run in a process of its own so that its memory can be measured.

`python -m benchmarks.csv_pipelines LIBRARY LAYOUT FILE` prints what it took as JSON.

Every pipeline delivers the same: for each tag its UTC stamps and its values as arrays of float
with the bad words as gaps, and the lines whose stamp is no time. Each is the fastest that was
found in its library for this.
"""

import json
import resource
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from benchmarks.exports import BAD_WORDS, ISO, LAYOUTS, Layout
from loop.signals import Real

Stamps: TypeAlias = npt.NDArray[np.datetime64]
Signals: TypeAlias = dict[str, tuple[Stamps, Real]]
Lines: TypeAlias = npt.NDArray[np.integer[Any]]
HEADER = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Delivery:
    """What a pipeline hands over.

    Attributes
    ----------
    signals : dict of str to tuple of ndarray
        For each tag its stamps (UTC, NaT where the word is no time) and its values (NaN for gaps).
    rejected : ndarray of int
        Lines of the file whose stamp is no time, from 1.
    """

    signals: Signals
    rejected: Lines


def _rejected(stamps: Stamps) -> Lines:
    return np.flatnonzero(np.isnat(stamps)) + 1 + HEADER


def with_loopwright(path: Path, layout: Layout) -> Delivery:  # noqa: ARG001 - it finds out itself
    """Read with Loopwright, told only that stamps without a zone are UTC."""
    from historian.csv_file import read_export
    from historian.options import ReadOptions

    export = read_export(path, options=ReadOptions(time_zone="UTC"))
    return Delivery(
        signals={
            tag: (
                signal.time.astype("datetime64[ns]", copy=False),
                signal.value.astype(np.float64, copy=False),
            )
            for tag, signal in export.signals.items()
        },
        rejected=np.array([rejection.line for rejection in export.accounting.rejections]),
    )


def with_pandas(path: Path, layout: Layout) -> Delivery:
    """Read with pandas' C engine; a long file's stamps are parsed once for each distinct word."""
    import pandas as pd

    time_format = "ISO8601" if layout.stamps == ISO else layout.stamps
    dtypes = {"timestamp": "str"} | ({"tag": "category"} if layout.long else {})
    frame = pd.read_csv(path, dtype=dtypes, na_values=list(BAD_WORDS), engine="c")
    if not layout.long:
        times = pd.to_datetime(frame["timestamp"], format=time_format, errors="coerce", utc=True)
        stamps = times.to_numpy("datetime64[us]")
        signals = {tag: (stamps, frame[tag].to_numpy()) for tag in layout.tags}
        return Delivery(signals=signals, rejected=_rejected(stamps))
    codes, words = pd.factorize(frame["timestamp"])
    distinct = pd.to_datetime(words, format=time_format, errors="coerce", utc=True)
    stamps = distinct.to_numpy("datetime64[us]")[codes]
    values = frame["value"].to_numpy()
    rows = frame.groupby("tag", observed=True).indices
    signals = {str(tag): (stamps[of_tag], values[of_tag]) for tag, of_tag in rows.items()}
    return Delivery(signals=signals, rejected=_rejected(stamps))


def with_pyarrow(path: Path, layout: Layout) -> Delivery:
    """Read with pyarrow; the stamps of a long file are a dictionary, so each is parsed once."""
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import csv

    words = pa.dictionary(pa.int32(), pa.string())
    types = {"timestamp": words, "tag": words} if layout.long else {"timestamp": pa.string()}
    options = csv.ConvertOptions(column_types=types, null_values=["", *BAD_WORDS])
    table = csv.read_csv(path, convert_options=options)
    if not layout.long:
        times = pc.strptime(table["timestamp"], layout.stamps, unit="s", error_is_null=True)
        stamps = times.to_numpy()
        signals = {tag: (stamps, table[tag].to_numpy()) for tag in layout.tags}
        return Delivery(signals=signals, rejected=_rejected(stamps))
    coded = table["timestamp"].combine_chunks()
    times = pc.strptime(coded.dictionary, layout.stamps, unit="s", error_is_null=True)
    stamps = times.to_numpy(zero_copy_only=False)[coded.indices.to_numpy()]
    tags = table["tag"].combine_chunks()
    codes = tags.indices.to_numpy().astype(np.int16)
    order = np.argsort(codes, kind="stable")
    ends = np.searchsorted(codes[order], np.arange(len(tags.dictionary) + 1))
    sorted_stamps, sorted_values = stamps[order], table["value"].to_numpy()[order]
    signals = {
        tag: (sorted_stamps[first:end], sorted_values[first:end])
        for tag, first, end in zip(tags.dictionary.to_pylist(), ends, ends[1:], strict=False)
    }
    return Delivery(signals=signals, rejected=_rejected(stamps))


def with_polars(path: Path, layout: Layout) -> Delivery:
    """Read with polars; its parser caches the stamps it has seen."""
    import polars as pl

    types: dict[str, Any] = {"timestamp": pl.String}
    if layout.long:
        types["tag"] = pl.Categorical
    frame = pl.read_csv(path, null_values=list(BAD_WORDS), schema_overrides=types)
    times = pl.col("timestamp").str.to_datetime(layout.stamps, strict=False, time_unit="us")
    frame = frame.with_columns(times)
    rejected = frame["timestamp"].is_null().arg_true().to_numpy() + 1 + HEADER
    if not layout.long:
        stamps = frame["timestamp"].to_numpy()
        signals = {tag: (stamps, frame[tag].to_numpy()) for tag in layout.tags}
        return Delivery(signals=signals, rejected=rejected)
    parts = frame.partition_by("tag", as_dict=True)
    signals = {
        str(tag): (part["timestamp"].to_numpy(), part["value"].to_numpy())
        for (tag, *_), part in parts.items()
    }
    return Delivery(signals=signals, rejected=rejected)


PIPELINES: Mapping[str, Callable[[Path, Layout], Delivery]] = {
    "Loopwright": with_loopwright,
    "pandas": with_pandas,
    "pyarrow": with_pyarrow,
    "polars": with_polars,
}
IMPORTS: Mapping[str, tuple[str, ...]] = {
    "Loopwright": ("historian.csv_file",),
    "pandas": ("pandas",),
    "pyarrow": ("pyarrow.csv", "pyarrow.compute"),
    "polars": ("polars",),
}


def contents(delivery: Delivery) -> dict[str, float]:
    """Count and sum what was read, so that two deliveries can be compared.

    Parameters
    ----------
    delivery : Delivery
        Signals of a file.

    Returns
    -------
    dict of str to float
        Values that have a stamp, their sum, the sum of their stamps since 2026 and the number of
        rejected lines.
    """
    known = total = since = 0.0
    epoch = np.datetime64("2026-01-01T00:00:00", "us")
    for stamps, values in delivery.signals.values():
        good = ~np.isnat(stamps) & np.isfinite(values)
        known += float(np.sum(good))
        total += float(np.sum(values[good]))
        elapsed = (stamps[good].astype("datetime64[us]") - epoch).astype(np.int64)
        since += float(np.sum(elapsed / 1e6))
    return {"values": known, "sum": total, "stamps": since, "rejected": delivery.rejected.size}


def peak_memory() -> float:
    """Largest resident memory that this process ever had. [bytes]

    On Linux from /proc: getrusage there starts at the size of the parent process.
    """
    status = Path("/proc/self/status")
    if status.exists():
        lines = status.read_text(encoding="ascii").splitlines()
        return float(next(line.split()[1] for line in lines if line.startswith("VmHWM"))) * 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else peak * 1024)


def main() -> None:
    """Read one file one way and print time, memory and what was read."""
    library, layout, path = sys.argv[1:]
    for module in IMPORTS[library]:
        import_module(module)
    bare = peak_memory()
    start, start_of_work = time.perf_counter(), time.process_time()
    delivery = PIPELINES[library](Path(path), LAYOUTS[layout])
    seconds, work = time.perf_counter() - start, time.process_time() - start_of_work
    peak = peak_memory()
    body = {"seconds": seconds, "work": work, "peak": peak, "bare": bare, **contents(delivery)}
    print(json.dumps(body))


if __name__ == "__main__":
    main()
