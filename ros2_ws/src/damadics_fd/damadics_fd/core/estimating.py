# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every estimator does, whatever the mode: the first half of a monitor."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.quality import Refused
from damadics_fd.core.record import Array, Floats, Ints, Plain, Saved
from damadics_fd.core.settings import Settings


class Estimating(Protocol):
    """The first half of a monitor, a node of its own in ROS: samples in, estimates out."""

    settings: Settings
    stride: int  # samples after which to ask for its judgement; 0: it has none
    refused: Refused | None  # the last refusal

    def update(
        self,
        stamp: int,
        cv: float,
        x1: float,
        p1: float,
        p2: float,
        t1: float,
        flow: float,
        ps: float,
    ) -> Estimate | Refused:
        """Take one sample; return the estimate, or why it was refused."""

    def run(
        self,
        stamp: Ints,
        signals: Sequence[Floats],
        reason: NDArray[np.uint8],
        estimates: Array,
    ) -> None:
        """Take a column of samples; the same results bit for bit."""

    def learned(self) -> Saved:
        """Return what was learned; ValueError where learning is not finished."""

    def restore(self, learned: Mapping[str, Plain]) -> None:
        """Take up what `learned` returned; ValueError where it is not that."""

    def relearn(self, after_repair: bool = False) -> None:
        """Learn anew."""

    def reset(self) -> None:
        """Forget everything."""

    @property
    def judgement(self) -> Judgement | None:
        """Return what the latest fault is taken for; None where that is not its task."""

    @property
    def status(self) -> str:
        """Say in one line what it does."""

    @property
    def phase(self) -> str:
        """Return the phase of the last estimate, a name out of `modes.PHASES`."""

    @property
    def monitoring(self) -> bool:
        """Tell whether decisions count."""

    @property
    def progress(self) -> float:
        """Return the share of the learning that is done."""

    @property
    def counters(self) -> dict[str, int]:
        """Return counts of samples by what became of them."""

    @property
    def failing(self) -> Refused | None:
        """Return what is wrong with the input for some time."""

    @property
    def failed_input(self) -> str:
        """Say what is wrong with the input for some time."""

    @property
    def last_rejection(self) -> str:
        """Say why the last refused sample was refused."""

    @property
    def last_stamp(self) -> int:
        """Return the stamp of the last accepted sample."""


def estimator_for(settings: Settings) -> Estimating:
    """
    Return the estimator of a mode.

    :param settings: all settings.
    :return: the approximator, or the models and tests of mode `scada`.
    """
    if settings.mode != 'scada':
        return Estimator(settings)
    # only here: its loops are a tenth of what a node has to load at its start
    from damadics_fd.core.scada.estimator import ScadaEstimator

    return ScadaEstimator(settings)
