import math
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from loop.record import Mode, Record


def test_a_record_keeps_its_own_read_only_copy() -> None:
    pv = np.array([1.0, 2.0, 3.0])
    record = Record(t=[0, 1, 2], pv=pv, op=[5, 5, 6])
    pv[0] = 99.0
    assert record.pv[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        record.pv[0] = 7.0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"t": [0, 1, 1]}, "sample 2 does not"),
        ({"t": [0, 1, math.nan]}, "finite"),
        ({"t": [0, 1]}, "as long as t"),
        ({"pv": [1, math.inf, 2]}, "gaps are NaN"),
        ({"pv": [[1, 2, 3]]}, "one dimension"),
        ({"op_before": math.nan}, "op_before"),
        ({"start": datetime(2026, 1, 1, tzinfo=timezone(timedelta(hours=1)))}, "UTC"),
        ({"start": datetime(2026, 1, 1)}, "UTC"),  # noqa: DTZ001
        ({"t": [], "pv": [], "op": []}, "at least one"),
    ],
)
def test_a_record_that_cannot_be_is_refused(fields: dict[str, object], words: str) -> None:
    good: dict[str, object] = {"t": [0, 1, 2], "pv": [1, 2, 3], "op": [4, 4, 4]}
    with pytest.raises(ValueError, match=words):
        Record(**(good | fields))


def test_cutting_keeps_every_signal_aligned() -> None:
    record = Record(
        t=np.arange(5.0),
        pv=np.array([1, 2, np.nan, 4, 5]),
        op=np.arange(5.0),
        sp=np.full(5, 3.0),
        mode=np.full(5, Mode.AUTO, dtype=np.int8),
        start=datetime(2026, 1, 1, tzinfo=UTC),
    )
    whole = record.without_gaps()
    assert whole.t.tolist() == [0, 1, 3, 4]
    assert whole.mode is not None
    assert len(whole.mode) == len(whole) == 4
    assert record.between(1, 3).op.tolist() == [1, 2, 3]
    assert (record.span, record.sample_time) == (4.0, 1.0)
    with pytest.raises(ValueError, match="no sample lies"):
        record.between(10, 11)
    with pytest.raises(ValueError, match="both"):
        Record(t=[0.0], pv=[math.nan], op=[1.0]).without_gaps()
