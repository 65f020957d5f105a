# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Date-time stamps as spreadsheets, pandas and historians write them, with or without zone."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone

from damadics_fd.bag.errors import BagError

NANO = 10**9
DAY = 86_400 * NANO
_MONTHS = ('jan', 'feb', 'mar', 'apr', 'may', 'jun', 'jul', 'aug', 'sep', 'oct', 'nov', 'dec')
_GERMAN = {'mrz': 'mar', 'mär': 'mar', 'mai': 'may', 'okt': 'oct', 'dez': 'dec'}
_ZONE = r'(?P<zone>Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)?'
_CLOCK = (
    r'(?:[T\s,]+(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2})(?:[.,:](?P<f>\d{1,9}))?)?'
    rf'\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*{_ZONE})?'
)
_SHAPES = (
    re.compile(rf'(?P<y>\d{{4}})[-/.](?P<mo>\d{{1,2}})[-/.](?P<d>\d{{1,2}}){_CLOCK}'),
    re.compile(rf'(?P<y>\d{{4}})(?P<mo>\d{{2}})(?P<d>\d{{2}}){_CLOCK}'),
    re.compile(  # ISO 8601 without signs between
        r'(?P<y>\d{4})(?P<mo>\d{2})(?P<d>\d{2})T?(?P<h>\d{2})(?P<m>\d{2})(?P<s>\d{2})'
        rf'(?:[.,](?P<f>\d{{1,9}}))?(?P<half>)\s*{_ZONE}'
    ),
    re.compile(rf'(?P<mon>[A-Za-zä]{{3}})\w*\.?\s+(?P<d>\d{{1,2}}),?\s+(?P<y>\d{{4}}){_CLOCK}'),
    re.compile(rf'(?P<d>\d{{1,2}})\.(?P<mo>\d{{1,2}})\.(?P<y>\d{{2,4}}){_CLOCK}'),
    re.compile(
        rf'(?P<d>\d{{1,2}})[-\s.]+(?P<mon>[A-Za-zä]{{3}})\w*[-\s.,]+(?P<y>\d{{2,4}}){_CLOCK}'
    ),
    re.compile(rf'(?P<a>\d{{1,2}})/(?P<b>\d{{1,2}})/(?P<y>\d{{2,4}}){_CLOCK}'),
)
_OF_DAY = re.compile(r'(?P<h>\d{1,4}):(?P<m>[0-5]\d):(?P<s>[0-5]\d)(?:[.,](?P<f>\d{1,9}))?')
_NOISE = re.compile(  # a weekday before the date, the name of a zone behind its offset
    r'^(?:mon|tue|wed|thu|fri|sat|sun)[a-z]*,?\s+|\[[\w/+-]+\]$', re.IGNORECASE
)
_DIGITS = re.compile(
    r'(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?:[01]\d|2[0-3])[0-5]\d[0-5]\d'
)


class Dates:
    """
    Read the date-time stamps of a table.

    Those without zone are taken as UTC: only their differences matter; those without a date count
    from the midnight before the first. Where day and month could
    be either (`03/04/2026`), the table decides.

    :param sample: some cells of the column.
    :raises BagError: where day and month cannot be told apart.
    """

    def __init__(self, sample: Sequence[str]):
        self._day_first = False
        slashed = [match for text in sample if (match := _SHAPES[-1].fullmatch(_plain(text)))]
        if slashed:
            first = max(int(match['a']) for match in slashed)
            second = max(int(match['b']) for match in slashed)
            if first <= 12 and second <= 12 and not any(match['half'] for match in slashed):
                changing = len({(m['a']) for m in slashed}), len({m['b'] for m in slashed})
                if changing[0] == changing[1]:
                    raise BagError(
                        f'day and month cannot be told apart in {slashed[0][0]!r}: write'
                        ' YYYY-MM-DD'
                    )
                self._day_first = changing[0] > changing[1]
            else:
                self._day_first = first > 12
        self._known: tuple[str, int] = ('', 0)  # the last date and its midnight [ns]
        self._midnights = self._latest = 0  # [ns] of times of day without a date

    def __call__(self, text: str) -> int:
        """
        Return a stamp [ns] since 1970.

        :raises ValueError: where the text is none.

        >>> Dates([])('2026-11-25 14:00:00.5+01:00')
        1795611600500000000
        """
        text = _plain(text)
        for shape in _SHAPES:
            if match := shape.fullmatch(text):
                return self._stamp(match)
        if match := _OF_DAY.fullmatch(text):
            return self._of_day(match)
        raise ValueError(f'{text!r} is no date')

    def _stamp(self, match: re.Match[str]) -> int:
        parts = match.groupdict()
        date = ''.join(str(parts.get(name)) for name in ('y', 'mo', 'mon', 'd', 'a', 'b'))
        if date != self._known[0]:
            self._known = date, self._midnight(parts)
        hour = int(parts['h'] or 0)
        if parts['half']:
            hour = hour % 12 + (12 if parts['half'][0] in 'pP' else 0)
        seconds = hour * 3600 + int(parts['m'] or 0) * 60 + int(parts['s'] or 0)
        nanoseconds = int((parts['f'] or '').ljust(9, '0') or 0)
        return self._known[1] + (seconds - _zone(parts['zone'])) * NANO + nanoseconds

    def _of_day(self, match: re.Match[str]) -> int:
        """Return a time without a date, counted on where midnight has passed [ns]."""
        seconds = int(match['h']) * 3600 + int(match['m']) * 60 + int(match['s'])
        stamp = seconds * NANO + int((match['f'] or '').ljust(9, '0'))
        if self._latest - stamp > DAY // 2:
            self._midnights += DAY
        self._latest = stamp
        return self._midnights + stamp

    def _midnight(self, parts: dict[str, str | None]) -> int:
        year = int(parts['y'] or 0)
        if year < 100:
            year += 2000 if year < 70 else 1900
        if parts.get('mon'):
            name = str(parts['mon']).lower()
            month, day = _MONTHS.index(_GERMAN.get(name, name)) + 1, int(parts['d'] or 0)
        elif parts.get('a'):
            day, month = int(parts['a'] or 0), int(parts['b'] or 0)
            if not self._day_first:
                day, month = month, day
        else:
            month, day = int(parts['mo'] or 0), int(parts['d'] or 0)
        return int(datetime(year, month, day, tzinfo=UTC).timestamp()) * NANO


def _plain(text: str) -> str:
    """Return a cell without quotes and without what says nothing."""
    return _NOISE.sub('', text.strip().strip('"').strip())


def _zone(text: str | None) -> int:
    """Return the seconds by which a zone is ahead of UTC."""
    if not text or text in ('Z', 'UTC', 'GMT'):
        return 0
    digits = text[1:].replace(':', '').ljust(4, '0')
    ahead = timezone(timedelta(hours=int(digits[:2]), minutes=int(digits[2:])))
    seconds = int(ahead.utcoffset(None).total_seconds())
    return -seconds if text[0] == '-' else seconds


def is_date(text: str) -> bool:
    """
    Tell whether a cell is a date, with or without a time of day, or a time of day.

    >>> is_date('25.11.2026 14:00:01,5'), is_date('20261125140001'), is_date('1795615200000')
    (True, True, False)
    """
    text = _plain(text)
    if text.isdigit():
        return bool(_DIGITS.fullmatch(text))  # of other numbers nobody knows
    return any(shape.fullmatch(text) for shape in (*_SHAPES, _OF_DAY))


def seconds_of(value: float) -> float:
    """
    Return what one of a number's unit is in seconds: s, ms, us or ns since 1970, by its size.

    >>> seconds_of(1.7e9), seconds_of(1.7e12), seconds_of(12.5)
    (1.0, 0.001, 1.0)
    """
    size = abs(value)
    for least, unit in ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)):
        if size >= least:
            return unit
    return 1.0
