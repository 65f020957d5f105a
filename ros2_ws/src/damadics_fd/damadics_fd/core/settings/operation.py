# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of how the stream of samples is taken: mode, rate, gaps, clock."""

from dataclasses import dataclass
from typing import ClassVar

from damadics_fd.core.field import Section, choice, number, whole
from damadics_fd.core.modes import MODES

HOLDING = ('monitor', 'scada')


@dataclass(frozen=True, eq=False, repr=False)
class Operation(Section):
    """Say how samples come and which monitor takes them."""

    DERIVED: ClassVar[tuple[str, ...]] = ('mode_code', 'dt')

    mode: str = choice(
        'paper: the printed method; monitor: learn, freeze, detect; '
        "scada: a control room's signals at 1 Hz",
        MODES,
        'monitor',
        paper='paper',
    )
    sample_rate: float = number(
        'Hz', 'nominal sample rate of the measurement', 0.01, 1e5, 200.0, paper=400.0, scada=1.0
    )
    gap_reset: float = number(
        's',
        'a longer gap restarts the filters; what is learned stays',
        1e-3,
        1e6,
        2.0,
        scada=30.0,
    )
    hold: float = number(
        's',
        'no decision for this time after such a restart',
        0.0,
        1e4,
        1.0,
        paper=0.0,
        scada=120.0,
        modes=HOLDING,
    )
    clock_jump: float = number(
        's', 'stamps further back than this may be a clock that was set back', 1e-3, 1e9, 1.0
    )
    clock_jump_samples: int = whole('', 'samples in order that confirm it', 2, 10000, 10)

    @property
    def mode_code(self) -> int:
        """Place of the mode in `modes.MODES`."""
        return MODES.index(self.mode)

    @property
    def dt(self) -> float:
        """Nominal sample period [s]."""
        return 1.0 / self.sample_rate
