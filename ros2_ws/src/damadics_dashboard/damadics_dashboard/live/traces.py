# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep the latest samples of a topic as columns, and thin them out honestly for a plot."""

import numpy as np
from damadics_fd.core.stamps import SECOND as NANO
from numpy.typing import NDArray

SMALLEST = 256  # samples that room is made for
Points = list[list[float | None]]


class Trace:
    """
    The latest samples of one topic.

    :param fields: names of the columns beside `stamp`.
    :param seconds: how much time is kept [s].
    :param capacity: number of samples that are kept at most.

    >>> trace = Trace(('x',), seconds=10.0, capacity=4)
    >>> trace.extend(np.array([(1, 0.5), (2, 0.7)], trace.dtype))
    >>> trace.rows['x'].tolist()
    [0.5, 0.7]
    """

    def __init__(self, fields: tuple[str, ...], seconds: float, capacity: int) -> None:
        self.dtype = np.dtype([('stamp', 'i8'), *((name, 'f8') for name in fields)])
        self._span = int(seconds * NANO)
        self._capacity = capacity
        self._data = np.zeros(0, self.dtype)  # grows with what is kept
        self._from = self._to = 0

    @property
    def rows(self) -> np.ndarray:
        """
        Return what is kept, oldest first.

        :return: a view that the next `extend` may overwrite.
        """
        return self._data[self._from : self._to]

    @property
    def newest(self) -> int:
        """
        Return the stamp of the newest sample.

        :return: [ns], -1 while there is none.
        """
        return int(self._data['stamp'][self._to - 1]) if self._to > self._from else -1

    def extend(self, rows: np.ndarray) -> None:
        """
        Add samples; where time jumps back, what was kept belongs to another run and goes.

        :param rows: samples in the order of their arrival.
        """
        stamps = rows['stamp']
        jumps = np.flatnonzero(np.diff(stamps, prepend=max(self.newest, stamps[0])) < 0)
        if len(jumps):
            self._from = self._to = 0
            rows = rows[jumps[-1] :]
        rows = rows[-self._capacity :]
        if self._to + len(rows) > len(self._data):
            self._make_room(len(rows))
        self._data[self._to : self._to + len(rows)] = rows
        self._to += len(rows)
        oldest = self._data['stamp'][self._to - 1] - self._span
        self._from = max(self._from, self._to - self._capacity)
        self._from += int(np.searchsorted(self.rows['stamp'], oldest))

    def _make_room(self, coming: int) -> None:
        """Move what is kept to the front, of an array a quarter larger than what is needed."""
        kept = (
            self.rows[-(self._capacity - coming) :] if coming < self._capacity else self.rows[:0]
        )
        needed = len(kept) + coming
        if needed + needed // 8 > len(self._data):
            data = np.zeros(max(needed + needed // 4, SMALLEST), self.dtype)
            data[: len(kept)] = kept
            self._data = data
        else:
            self._data[: len(kept)] = kept.copy()
        self._from, self._to = 0, len(kept)

    def since(self, stamp: int) -> np.ndarray:
        """
        Return the samples from a stamp on.

        :param stamp: [ns].
        :return: a view as `rows`.
        """
        rows = self.rows
        return rows[int(np.searchsorted(rows['stamp'], stamp)) :]


def envelope(
    stamp: NDArray[np.int64], value: NDArray[np.float64], width: int, *, largest: bool = False
) -> Points:
    """
    Thin a signal out to the least and the greatest value of every interval, in their order.

    Nothing that lasted a single sample is lost, and nothing is invented. The intervals lie fixed
    in time, so that a plot that moves on does not flicker. Where samples are missing for more
    than five intervals and half a second, the line is broken.

    :param stamp: rising [ns].
    :param value: the signal; NaN is left out.
    :param width: of the intervals [ns].
    :param largest: only the greatest values, for what is compared with a limit from below.
    :return: points (time [s], value).

    >>> envelope(np.arange(6) * NANO, np.array([0.0, 5, 1, -1, 2, 3]), 3 * NANO)
    [[0.0, 0.0], [1.0, 5.0], [3.0, -1.0], [5.0, 3.0]]
    """
    good = np.isfinite(value)
    stamp, value = stamp[good], value[good]
    if not len(stamp):
        return []
    bucket = stamp // width
    starts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
    ends = np.append(starts[1:], len(stamp))
    low, high = _extremes(value, starts, ends)
    if largest:
        low = high
    first, last = np.minimum(low, high), np.maximum(low, high)
    points: Points = []
    gap = max(5 * width, NANO // 2)
    before = int(stamp[0])
    at, end = (stamp * 1e-9).tolist(), stamp[ends - 1].tolist()
    for i, j, k, edge in zip(first.tolist(), last.tolist(), starts.tolist(), end, strict=True):
        if int(stamp[k]) - before > gap:
            points.append([before * 1e-9, None])
        points.append([at[i], float(value[i])])
        if j != i:
            points.append([at[j], float(value[j])])
        before = edge
    return points


def _extremes(
    value: NDArray[np.float64], starts: NDArray[np.intp], ends: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of least and greatest value of each interval."""
    sizes = ends - starts
    owner = np.repeat(np.arange(len(starts)), sizes)
    places = []
    for extreme in (np.minimum.reduceat(value, starts), np.maximum.reduceat(value, starts)):
        hits = np.flatnonzero(value == extreme[owner])
        _, first = np.unique(owner[hits], return_index=True)
        places.append(hits[first])
    return places[0], places[1]


def block_means(rows: np.ndarray, x: str, y: str, width: int) -> Points:
    """
    Average two columns over fixed intervals, for a plot of one over the other.

    :param rows: samples with `stamp`.
    :param x: name of the abscissa.
    :param y: name of the ordinate.
    :param width: of the intervals [ns].
    :return: points (mean of x, mean of y).
    """
    rows = rows[np.isfinite(rows[x]) & np.isfinite(rows[y])]
    if not len(rows):
        return []
    bucket = rows['stamp'] // width
    starts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
    sizes = np.diff(np.append(starts, len(rows)))
    means = [np.add.reduceat(rows[name], starts) / sizes for name in (x, y)]
    return [list(pair) for pair in zip(*(m.round(5).tolist() for m in means), strict=True)]
