"""Rows of one loop as one packed array: sorted, de-duplicated, merged."""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from historian.samples import Samples
from loop.signals import Codes, Flags, Real

Rows: TypeAlias = npt.NDArray[np.void]
Integers: TypeAlias = npt.NDArray[np.signedinteger[Any]]

ROW = np.dtype([("time", "<i8"), ("sp", "<f8"), ("pv", "<f8"), ("op", "<f8"), ("mode", "i1")])
SIGNALS = ("sp", "pv", "op")
DAY = 86_400_000_000  # microseconds
UNKNOWN = -1  # loop.record.Mode.UNKNOWN: no mode was given


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Merge:
    """What an upload means to rows already stored.

    Attributes
    ----------
    known : ndarray of bool, shape (n,)
        Rows of the upload at instants that are stored.
    differs : ndarray of bool, shape (n,)
        Rows of the upload that change a stored row.
    places : ndarray of int, shape (m,)
        Positions of the stored rows that change, one for each row that differs.
    values : ndarray of ROW, shape (m,)
        What those stored rows become.
    """

    known: Flags
    differs: Flags
    places: Integers
    values: Rows


def rows_of(samples: Samples, start: int = 0, end: int | None = None) -> Rows:
    """Pack samples, or those from start to before end, into rows in their own order."""
    part = slice(start, end)
    rows = np.empty(samples.time[part].size, ROW)
    rows["time"] = samples.time[part].astype(np.int64)
    rows["mode"] = samples.mode[part]
    for name in SIGNALS:
        rows[name] = getattr(samples, name)[part]
    return rows


def samples_of(rows: Rows) -> Samples:
    """Unpack rows into samples."""
    return Samples(
        time=rows["time"].astype("datetime64[us]"),
        pv=np.ascontiguousarray(rows["pv"]),
        sp=np.ascontiguousarray(rows["sp"]),
        op=np.ascontiguousarray(rows["op"]),
        mode=np.ascontiguousarray(rows["mode"]),
    )


def sorted_once(rows: Rows) -> Rows:
    """Sort by time and join rows of one instant: of two values of a cell the later row's stays."""
    steps = np.diff(rows["time"])
    if np.all(steps > 0):
        return rows
    if np.any(steps < 0):
        rows = rows[np.argsort(rows["time"], kind="stable")]
        steps = np.diff(rows["time"])
    starts = np.flatnonzero(np.r_[True, steps > 0])
    if starts.size == rows.size:
        return rows
    joined = rows[starts]
    order = np.arange(rows.size)
    for name in (*SIGNALS, "mode"):
        last_known = np.maximum.reduceat(np.where(has_value(rows[name]), order, -1), starts)
        found = last_known >= 0
        joined[name][found] = rows[name][last_known[found]]
    return joined


def merge(stored: Rows, uploaded: Rows) -> Merge:
    """Lay an upload over stored rows: the upload's cell wins wherever it holds a value.

    Parameters
    ----------
    stored : ndarray of ROW, at least one
    uploaded : ndarray of ROW, shape (n,)
        Rows with strictly increasing times, as the stored ones.
    """
    place = np.minimum(np.searchsorted(stored["time"], uploaded["time"]), stored.size - 1)
    there = stored["time"][place] == uploaded["time"]
    over, under = uploaded[there], stored[place[there]]
    values = under.copy()
    changed = np.zeros(over.size, np.bool_)
    for name in (*SIGNALS, "mode"):
        brings = has_value(over[name])
        changed |= brings & (over[name] != under[name])  # NaN differs from every number: filled
        values[name] = np.where(brings, over[name], under[name])
    differs = there.copy()
    differs[there] = changed
    return Merge(known=there, differs=differs, places=place[differs], values=values[changed])


def has_value(cells: Real | Codes) -> Flags:
    """Tell which cells of a signal or of the mode hold a value."""
    return cells != UNKNOWN if cells.dtype == np.int8 else ~np.isnan(cells)
