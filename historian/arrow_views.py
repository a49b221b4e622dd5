"""Look at Arrow's memory with numpy, and back, without the detour through pandas.

`pyarrow.Array.to_numpy`, `pyarrow.array` and `pyarrow.scalar` import pandas when they are first
called, which takes longer and more memory than reading most exports.
"""

from typing import Any

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
    return as_stored(array).astype(np.int64, copy=False)


def as_stored(array: pa.Array) -> npt.NDArray[np.signedinteger[Any]]:
    """See an array of whole numbers or instants without nulls in the width it is stored in."""
    kind = np.dtype(f"i{array.type.bit_width // 8}")
    if not len(array):
        return np.zeros(0, dtype=kind)
    return np.frombuffer(array.buffers()[1], dtype=kind)[array.offset : array.offset + len(array)]


def array_of(values: npt.NDArray[Any], kind: pa.DataType, missing: Flags | None = None) -> pa.Array:
    """Lay numbers of the width of an Arrow type out as an array, null where they are missing."""
    known, nulls = None, 0
    if missing is not None and missing.any():
        known = pa.py_buffer(np.packbits(~missing, bitorder="little"))
        nulls = int(np.count_nonzero(missing))
    data = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(kind, values.size, [known, data], nulls)


def whole_number(value: int, kind: pa.DataType) -> pa.Scalar:
    """Lay a whole number, or a day or an instant counted from 1970, out as a scalar."""
    return array_of(np.array([value], dtype=f"i{kind.bit_width // 8}"), kind)[0]


def array_of_flags(flags: Flags) -> pa.Array:
    """Lay flags out as an array."""
    bits = pa.py_buffer(np.packbits(flags, bitorder="little"))
    return pa.Array.from_buffers(pa.bool_(), flags.size, [None, bits])


def array_of_text(text: str) -> pa.Array:
    """Lay one text out as an array."""
    data = text.encode()
    ends = np.array([0, len(data)], dtype=np.int32)
    return pa.Array.from_buffers(pa.string(), 1, [None, pa.py_buffer(ends), pa.py_buffer(data)])


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
    return array.take(array_of(rows.astype(np.int64, copy=False), pa.int64()))


def lengths(array: pa.Array) -> Integers:
    """Measure the cells of a string array that has some. [bytes]"""
    offsets = np.frombuffer(array.buffers()[1], dtype=np.int32)
    return np.diff(offsets[array.offset : array.offset + len(array) + 1]).astype(np.int64)


def equals(array: pa.Array, text: str) -> Flags:
    """Tell which cells of a string array are exactly a text."""
    return as_flags(pc.is_in(array, value_set=array_of_text(text)))


def _validity(array: pa.Array) -> Flags:
    return _bits(array.buffers()[0], array.offset, len(array))


def _bits(buffer: pa.Buffer, offset: int, count: int) -> Flags:
    packed = np.frombuffer(buffer, dtype=np.uint8)
    return np.unpackbits(packed, count=offset + count, bitorder="little")[offset:].astype(np.bool_)
