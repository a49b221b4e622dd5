"""Whatever is uploaded in whatever order, the store holds what a plain dictionary would."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from historian.sample_rows import ROW, merge, rows_of, samples_of, sorted_once
from historian.sample_store import SampleStore
from historian.samples import Samples

DAYS = 86_400_000_000
Cells = tuple[float, float, float, int]

stamps = st.one_of(
    st.integers(0, 5).map(lambda n: n * 1_000_000),
    st.integers(0, 3).map(lambda n: n * DAYS + 7),
    st.integers(0, 4 * DAYS),
)
values = st.one_of(st.just(math.nan), st.sampled_from([0.0, -0.0, 1.0, 1e300]), st.floats(-9, 9))
rows = st.tuples(stamps, values, values, values, st.integers(-1, 3))
uploads = st.lists(rows, min_size=1, max_size=12)


def samples(upload: list[tuple[int, float, float, float, int]]) -> Samples:
    return samples_of(np.array(upload, dtype=ROW))


def laid_over(old: Cells, new: Cells) -> Cells:
    sp, pv, op = (o if math.isnan(n) else n for o, n in zip(old[:3], new[:3], strict=True))
    return sp, pv, op, old[3] if new[3] == -1 else new[3]


def table_of(stored: Samples) -> dict[int, Cells]:
    return {
        int(row["time"]): (float(row["sp"]), float(row["pv"]), float(row["op"]), int(row["mode"]))
        for row in rows_of(stored)
    }


def same(one: dict[int, Cells], other: dict[int, Cells]) -> bool:
    return one.keys() == other.keys() and all(
        np.array_equal(one[time], other[time], equal_nan=True) for time in one
    )


@settings(max_examples=15, deadline=None)
@given(
    history=st.lists(st.tuples(st.sampled_from("ABC"), uploads), max_size=5),
    tidy_at=st.integers(0, 5),
)
def test_the_store_holds_what_a_dictionary_would(
    history: list[tuple[str, list[tuple[int, float, float, float, int]]]], tidy_at: int
) -> None:
    model: dict[str, dict[int, Cells]] = {}
    with TemporaryDirectory() as folder:
        store = SampleStore(Path(folder))
        for turn, (loop, upload) in enumerate(history):
            if turn == tidy_at:
                store.tidy()
            before = dict(model.get(loop, {}))
            for time, *cells in upload:
                known = model.setdefault(loop, {})
                new = (cells[0], cells[1], cells[2], int(cells[3]))
                known[time] = laid_over(known[time], new) if time in known else new
            result = store.write(loop, samples(upload))
            assert result.new == len(model[loop]) - len(before)
            assert result.replaced == sum(
                not np.array_equal(cells, model[loop][time], equal_nan=True)
                for time, cells in before.items()
            )
            assert result.rows == len(upload)
            assert result.repeated == len(upload) - len({row[0] for row in upload})
            assert store.write(loop, samples(upload)).new == 0
        for loop, known in model.items():
            assert same(table_of(store.read(loop)), known)
            assert store.span(loop).rows == len(known)


@given(upload=uploads, cut=st.integers(0, 12))
def test_an_upload_in_pieces_is_the_upload(
    upload: list[tuple[int, float, float, float, int]], cut: int
) -> None:
    whole = sorted_once(np.array(upload, dtype=ROW))
    head, tail = (sorted_once(np.array(part, dtype=ROW)) for part in (upload[:cut], upload[cut:]))
    if not (head.size and tail.size):
        return
    outcome = merge(head, tail)
    head[outcome.places] = outcome.values
    joined = np.sort(np.concatenate([head, tail[~outcome.known]]), order="time")
    assert same(table_of(samples_of(joined)), table_of(samples_of(whole)))
