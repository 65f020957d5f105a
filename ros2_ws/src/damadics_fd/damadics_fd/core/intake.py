# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The intake of samples: what every estimator counts, refuses and says of its input."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.quality import (
    ACCEPTED,
    NOT_FINITE,
    OUT_OF_RANGE,
    REASONS,
    SPIKE,
    Quality,
    Reason,
    Refused,
    signal_fault,
)
from damadics_fd.core.record import Floats, Ints
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings

FAILED = 4.0  # s of refused samples after which the input counts as failed


class Intake:
    """
    Count samples and remember the last one that was refused.

    :param settings: all settings.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.quality = Quality.rows()
        self.refused: Refused | None = None  # the last one
        self._settings = settings.record()

    def forget(self) -> None:
        """Begin to count anew."""
        self.quality[:] = Quality.rows()
        self.refused = None

    @property
    def last_rejection(self) -> str:
        """
        Say why the last refused sample was refused.

        :return: name of the reason, signal and value; '' where none was refused.
        """
        return self.refused.text if self.refused else ''

    @property
    def accepted(self) -> int:
        """
        Return how many samples were accepted.

        :return: the count.
        """
        return int(self.quality['counts'][0, ACCEPTED])

    @property
    def last_stamp(self) -> int:
        """
        Return the stamp of the last accepted sample.

        :return: [ns].
        """
        return int(self.quality['stamp'][0])

    @property
    def counters(self) -> dict[str, int]:
        """
        Return how many samples were accepted and refused for which reason, and interruptions.

        :return: counts by name.
        """
        q = self.quality[0]
        counts = {name: int(n) for name, n in zip(REASONS, q['counts'], strict=True)}
        for name in ('gaps', 'missed', 'restarts', 'clock_jumps', 'refused_in_a_row'):
            counts[name] = int(q[name])
        return counts

    @property
    def failing(self) -> Refused | None:
        """
        Return what is wrong with the input where nothing else has come for `FAILED` seconds.

        :return: the last refusal; None where all is well.
        """
        return self.refused if self._lasting >= FAILED else None

    @property
    def failed_input(self) -> str:
        """
        Say what is wrong with the input where nothing else has come for `FAILED` seconds.

        :return: signal, value, how long in nominal sample periods, remedy; '' where all is well.
        """
        failing = self.failing
        if failing is None:
            return ''
        return f'{failing.text}, for {self._lasting:.0f} s: {failing.remedy}'

    @property
    def _lasting(self) -> float:
        return int(self.quality['refused_in_a_row'][0]) / self.settings.sample_rate

    def note(self, reason: int, stamp: int, values: Sequence[float], before: int) -> Refused:
        """
        Remember a refusal.

        :param reason: why.
        :param stamp: of the sample [ns].
        :param values: its signals, in the order of SIGNALS.
        :param before: stamp of the last accepted sample before it [ns].
        :return: the refusal.
        """
        signal, text = '', f'{stamp} ns after {before} ns'
        if reason in (NOT_FINITE, OUT_OF_RANGE):
            for index, value in enumerate(values):
                if signal_fault(self._settings[0], index, value) == reason:
                    signal = SIGNALS[index]
                    text = f'{signal} = {value:g}'
                    break
        elif reason == SPIKE:
            index = int(self.quality['spike'][0])
            signal, text = SIGNALS[index], f'{SIGNALS[index]} = {values[index]:g}'
        self.refused = Refused(Reason(reason), f'{REASONS[reason]}: {text}', signal)
        return self.refused

    def note_column(
        self, reason: NDArray[np.uint8], stamp: Ints, signals: Sequence[Floats], before: int
    ) -> None:
        """
        Remember the last refusal in a column.

        :param reason: of each sample.
        :param stamp: of each sample [ns].
        :param signals: columns in the order of SIGNALS.
        :param before: stamp of the last accepted sample before the column [ns].
        """
        refused = np.flatnonzero(reason)
        if not len(refused):
            return
        last = int(refused[-1])
        accepted = np.flatnonzero(reason[:last] == ACCEPTED)
        self.note(
            int(reason[last]),
            int(stamp[last]),
            [float(signal[last]) for signal in signals],
            int(stamp[accepted[-1]]) if len(accepted) else before,
        )
