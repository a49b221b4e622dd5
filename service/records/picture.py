"""Samples of a loop as few points, read a day at a time."""

from datetime import datetime
from uuid import UUID

import numpy as np

from historian.downsampling import Picture, downsample
from historian.resampling import Series, usual_gap
from historian.sample_store import SampleStore
from historian.samples import Samples, Times, instant
from loop.record import Mode
from loop.signals import Codes, Real
from service.records.schemas import ModeBody, SamplesBody, SignalBody


def picture_of(
    store: SampleStore,
    loop_id: UUID,
    *,
    start: datetime | None,
    end: datetime | None,
    max_points: int,
    max_gap: float | None,
) -> SamplesBody:
    """Read a range of samples and thin every signal to at most `max_points`.

    Parameters
    ----------
    store : SampleStore
        Holds the samples.
    loop_id : UUID
        Name of the loop in the store.
    start, end : datetime, optional
        Range with start <= time < end. Default: everything.
    max_points : int
        Most points of a signal, with those that mark gaps.
    max_gap : float, optional
        Distance from which neighbours have a gap between them. Default: 1.5 times the distance
        that 95 % of the neighbours keep, for each signal on its own. [s]
    """
    reader = _Reader(max_points, max_gap)
    for part in store.read_in_parts(loop_id, start, end):
        reader.add(part)
    return SamplesBody(
        loop_id=loop_id,
        samples=reader.rows,
        first_time=reader.first_time,
        last_time=reader.last_time,
        max_points=max_points,
        pv=reader.signal("pv"),
        sp=reader.signal("sp"),
        op=reader.signal("op"),
        mode=reader.modes(),
    )


class _Reader:
    """Takes samples a day at a time; its clock starts with the first of them."""

    def __init__(self, max_points: int, max_gap: float | None) -> None:
        self.rows = 0
        self._max_points = max_points
        self._max_gap = max_gap
        self._origin = np.datetime64(0, "us")
        self._last = self._origin
        self._signals: dict[str, Picture] = {}
        self._mode_times: list[Real] = []
        self._modes: list[Codes] = []
        self._mode = int(Mode.UNKNOWN)

    @property
    def first_time(self) -> datetime | None:
        return _moment(self._origin) if self.rows else None

    @property
    def last_time(self) -> datetime | None:
        return _moment(self._last) if self.rows else None

    def add(self, part: Samples) -> None:
        if not self.rows:
            self._origin = part.time[0]
        self._last = part.time[-1]
        self.rows += len(part)
        t = (part.time - self._origin).astype(np.int64) / 1e6
        for name in ("pv", "sp", "op"):
            self._add_signal(name, t, getattr(part, name))
        self._add_modes(t, part.mode)

    def _add_signal(self, name: str, t: Real, values: Real) -> None:
        if name not in self._signals:
            if np.all(np.isnan(values)):
                return
            max_gap = usual_gap(t, values) if self._max_gap is None else self._max_gap
            self._signals[name] = Picture(self._max_points, max_gap=max_gap)
        self._signals[name].add(t, values)

    def _add_modes(self, t: Real, modes: Codes) -> None:
        changes = np.flatnonzero(np.diff(modes, prepend=np.int8(self._mode)))
        self._mode_times.append(t[changes])
        self._modes.append(modes[changes])
        self._mode = int(modes[-1])

    def signal(self, name: str) -> SignalBody:
        if name not in self._signals:
            return SignalBody(time=[], values=[])
        series = self._signals[name].series()
        gap = np.isnan(series.values)
        values = series.values.tolist()
        return SignalBody(
            time=self._stamps(series.t),
            values=[None if missing else v for v, missing in zip(values, gap, strict=True)],
        )

    def modes(self) -> ModeBody:
        if not self.rows:
            return ModeBody(time=[], values=[])
        codes = np.concatenate(self._modes).astype(np.float64)
        series = Series(t=np.concatenate(self._mode_times), values=codes)
        if series.t.size > self._max_points:
            series = downsample(series.t, series.values, self._max_points)
        return ModeBody(
            time=self._stamps(series.t), values=[Mode(int(code)).name for code in series.values]
        )

    def _stamps(self, t: Real) -> list[str]:
        times: Times = self._origin + np.round(t * 1e6).astype("timedelta64[us]")
        return [f"{stamp}Z" for stamp in np.datetime_as_string(times, unit="us").tolist()]


def _moment(time: np.datetime64) -> datetime:
    return instant(int(time.astype(np.int64)))
