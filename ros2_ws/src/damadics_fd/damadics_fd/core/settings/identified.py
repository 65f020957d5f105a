# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `commission` has found out about a valve, in every mode."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from damadics_fd.core.record import Plain, Saved

OK, LIMITED, REFUSED = 'ok', 'limited', 'refused'
VERDICTS = (OK, LIMITED, REFUSED)


@dataclass(frozen=True)
class Identified:
    """Hold settings of a valve, how far they are to be trusted, and why."""

    verdict: str  # OK, LIMITED or REFUSED
    settings: Mapping[str, Plain]  # by name; those that equal the defaults may be left out
    report: tuple[str, ...]  # lines for people: what was found, in the order to be printed
    reasons: tuple[str, ...] = ()  # why it is not OK: what does not fit, what will be missed
    learned: Mapping[str, Plain] = field(default_factory=dict)  # for a reference; {}: none
    numbers: Mapping[str, float] = field(default_factory=dict)  # what the verdict rests on
    twin: Mapping[str, Plain] = field(default_factory=dict)  # model for the plant; {}: none

    def judgement(self) -> Saved:
        """
        Return the verdict as the file of the valve and the reference keep it.

        :return: `verdict`; `reasons` where it is not OK; `report`, the lines that were printed;
            and the numbers.
        """
        kept: Saved = {'verdict': self.verdict}
        if self.reasons:
            kept['reasons'] = list(self.reasons)
        kept['report'] = list(self.report)
        kept.update(self.numbers)
        return kept


@dataclass(frozen=True)
class FaultFree:
    """Hold one fault-free recording as `commission` hands it to `identify` of a mode."""

    name: str
    columns: Mapping[str, np.ndarray]  # `stamp` [ns] and the signals by name, NaN: not measured
