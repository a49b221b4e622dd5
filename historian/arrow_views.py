"""Look at Arrow's memory with numpy, and back, without the detour through pandas.

`pyarrow.Array.to_numpy` and `pyarrow.array` import pandas when they are first called, which takes
longer and more memory than reading most exports.
"""

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from loop.signals import Flags, Real

Integers = npt.NDArray[np.int64]


def as_floats(array: pa.Array) -> Real:
    """See a float64 array as numbers, NaN where it is null; read-only where nothing is null."""
    if not len(array):
        return np.zeros(0)
    values = np.frombuffer(array.buffers()[1], dtype=np.float64)
    values = values[array.offset : array.offset + len(array)]
    if not array.null_count:
        return values
    return np.where(_validity(array), values, np.nan)


def as_integers(array: pa.Array) -> Integers:
    """See an int32 or int64 array without nulls as numbers."""
    if not len(array):
        return np.zeros(0, dtype=np.int64)
    kind = np.int32 if array.type == pa.int32() else np.int64
    values = np.frombuffer(array.buffers()[1], dtype=kind)
    return values[array.offset : array.offset + len(array)].astype(np.int64, copy=False)


def as_flags(array: pa.Array) -> Flags:
    """See a boolean array without nulls as flags."""
    return _bits(array.buffers()[1], array.offset, len(array))


def different(numbers: Integers) -> list[int]:
    """List the different ones of some small whole numbers, in order.

    `numpy.unique` would import masked arrays, which takes longer than to read a small export.
    """
    return np.flatnonzero(np.bincount(numbers)).tolist()


def taken(array: pa.Array, rows: Integers) -> pa.Array:
    """Take some rows of an array."""
    places = np.ascontiguousarray(rows, dtype=np.int64)
    return array.take(pa.Array.from_buffers(pa.int64(), places.size, [None, pa.py_buffer(places)]))


def lengths(array: pa.Array) -> Integers:
    """Measure the cells of a string array that has some. [bytes]"""
    offsets = np.frombuffer(array.buffers()[1], dtype=np.int32)
    return np.diff(offsets[array.offset : array.offset + len(array) + 1]).astype(np.int64)


def equals(array: pa.Array, text: str) -> Flags:
    """Tell which cells of a string array are exactly a text."""
    data = text.encode()
    ends = np.array([0, len(data)], dtype=np.int32)
    only = pa.Array.from_buffers(pa.string(), 1, [None, pa.py_buffer(ends), pa.py_buffer(data)])
    return as_flags(pc.is_in(array, value_set=only))


def _validity(array: pa.Array) -> Flags:
    return _bits(array.buffers()[0], array.offset, len(array))


def _bits(buffer: pa.Buffer, offset: int, count: int) -> Flags:
    packed = np.frombuffer(buffer, dtype=np.uint8)
    return np.unpackbits(packed, count=offset + count, bitorder="little")[offset:].astype(np.bool_)
