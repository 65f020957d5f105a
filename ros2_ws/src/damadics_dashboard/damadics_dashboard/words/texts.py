# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page's words and numbers in the languages it knows."""

import math
import time
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path

import yaml
from damadics_fd.causes import CauseTable, load_causes
from damadics_fd.core.stamps import SECOND, is_date

LANGUAGES = {'en': 'English', 'de': 'Deutsch'}
LONG = 1100.0  # days, above which a duration is told in years
DASH = '–'
Word = str | float | int
_edited: list[Path] = []  # the file of `use_causes`


class Texts:
    """
    The words of one language.

    :param language: its code, one of LANGUAGES.
    """

    def __init__(self, language: str) -> None:
        self.language = language
        loaded: Mapping[str, str] = yaml.safe_load(_content(f'{language}.yaml'))
        faults: Mapping[str, Mapping[str, str]] = yaml.safe_load(_content('faults.yaml'))
        self.entries = {**loaded, **faults[language]}
        self.causes: CauseTable = load_causes(_edited[-1] if _edited else None, language)

    def __call__(self, key: str, **values: Word) -> str:
        """
        Return a text.

        :param key: of its entry.
        :param values: that it tells.
        :return: the text, as data: it is not markup.
        """
        text = self.entries[key]
        return text.format(**values) if values else text

    def number(self, value: float | None, unit: str = '', digits: int = 3) -> str:
        """
        Word a number.

        :param value: the number.
        :param unit: its unit.
        :param digits: significant digits.
        :return: text, a dash where there is no number.
        """
        if value is None or not math.isfinite(value):
            return DASH
        return self.local(f'{value:.{digits}g}') + (f' {unit}' if unit else '')

    def local(self, number: str) -> str:
        """
        Return a number as this language writes it.

        :param number: as Python writes it.
        :return: the same with the decimal sign of the language.
        """
        return number.replace('.', ',') if self.language == 'de' else number

    def percent(self, share: float | None) -> str:
        """
        Word a share.

        :param share: 0..1.
        :return: in percent, a dash where there is none.
        """
        if share is None or not math.isfinite(share):
            return DASH
        return f'{100.0 * share:.0f} %'

    def duration(self, seconds: float | None) -> str:
        """
        Word a duration.

        :param seconds: duration [s].
        :return: short text.

        >>> texts('en').duration(0.31), texts('en').duration(599.9), texts('en').duration(7300.0)
        ('0.3 s', '10 min 0 s', '2 h 2 min')
        >>> texts('en').duration(165 * 86400.0), texts('en').duration(4917 * 86400.0)
        ('165 days', '13 years')
        """
        if seconds is None or not math.isfinite(seconds):
            return DASH
        seconds = max(seconds, 0.0)
        if round(seconds, 1) < 10.0:
            return self.local(f'{seconds:.1f} s')
        whole = round(seconds)
        if whole < 60:
            return f'{whole} s'
        if whole < 3600:
            return f'{whole // 60} min {whole % 60} s'
        minutes = round(whole / 60.0)
        if minutes < 48 * 60:
            return f'{minutes // 60} h {minutes % 60} min'
        days = seconds / 86400.0
        if days < LONG:
            return self('days', number=f'{days:.0f}')
        return self('years', number=f'{days / 365.25:.0f}')

    def moment(self, stamp: int) -> str:
        """
        Word a stamp: seconds of a simulation, or local time with its zone.

        :param stamp: [ns].
        :return: short text.

        >>> texts('en').moment(81_120_000_000)
        '81.12 s (simulated)'
        """
        if stamp <= 0:
            return DASH
        if not is_date(stamp):
            return self('simulated_time', time=self.local(f'{stamp / SECOND:.2f}'))
        local = time.localtime(stamp / SECOND)
        return time.strftime('%Y-%m-%d %H:%M:%S ', local) + zone(local)


def _content(name: str) -> str:
    return resources.files('damadics_dashboard.words').joinpath(name).read_text('utf-8')


def zone(local: time.struct_time) -> str:
    """
    Return the zone of a local time.

    :param local: the time.
    :return: such as UTC+02:00.
    """
    offset = local.tm_gmtoff // 60
    if not offset:
        return 'UTC'
    return f'UTC{"+" if offset > 0 else "-"}{abs(offset) // 60:02d}:{abs(offset) % 60:02d}'


@cache
def texts(language: str) -> Texts:
    """
    Return the words of a language.

    :param language: its code; English for one that is not known.
    :return: the words.
    """
    return Texts(language if language in LANGUAGES else 'en')


def use_causes(path: Path | None) -> None:
    """
    Take the texts of causes from a file that somebody has edited, as detectors do.

    :param path: a `causes.yaml`; what it leaves out is as before. None: no such file.
    :raises CauseTableError: listing everything that is wrong in it.
    :raises OSError: where it cannot be read.
    """
    if path is not None:
        load_causes(path)
    _edited[:] = [path] if path is not None else []
    texts.cache_clear()


def preferred(accepted: str) -> str:
    """
    Choose a language for a browser.

    :param accepted: its header Accept-Language.
    :return: code of the first one that the page knows.

    >>> preferred('fr-CH, de;q=0.9, en;q=0.8')
    'de'
    """
    for part in accepted.split(','):
        code = part.split(';')[0].strip().lower()[:2]
        if code in LANGUAGES:
            return code
    return 'en'
