# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Refuse to learn what cannot be a valve that works."""

import numpy as np

from damadics_fd.core.scada.laws.fit_stem import StemFit
from damadics_fd.core.scada.laws.robust import Floats, spread_of
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import LAW, Reference

UNKNOWN_GAIN = 0.2  # standard error of the stem's gain above which the record shows no motion
GAIN = 0.1  # a positioner's gain may differ from 1 by this
UNRELATED = 0.3  # fitted gain below which the stem does not follow CV
UNEXPLAINED = 0.45  # share of the deviation of X that a law leaves which does not see the motion
REACH = 0.3  # by which the reach of the stem may differ from that of CV
OFFSET = 0.1
SIGMAS = 4.0
UNLIKE = 'this does not look like a valve that works'
FLOW_GAIN = 0.1
ABSURD = 1e3  # times its range: no signal of a valve
STRAY = 0.01  # share of samples that may say so
MEASURED = ('CV', 'X', 'P1', 'P2', 'T1', 'the flow')


class LearningError(ValueError):
    """The record cannot serve as a reference; the message names cause and remedy."""


def possible(samples: Floats) -> Floats:
    """
    Leave out numbers that no valve has: sums of their squares have no end.

    :param samples: rows of scaled samples, time first; NaN where not measured.
    :return: the same with NaN for them.
    :raises LearningError: where one signal has many, naming it.
    """
    absurd = np.abs(samples) > ABSURD
    absurd[:, 0] = False
    for name, share in zip(MEASURED, absurd[:, 1:].mean(axis=0).tolist(), strict=True):
        if share > STRAY:
            raise LearningError(
                f'{name} is more than {ABSURD:g} times its range in {100.0 * share:.0f} % of the '
                'samples: values that no valve has; check units and what sends them'
            )
    return np.where(absurd, np.nan, samples)


def check_residual(r1: Floats) -> None:
    """
    Refuse a record that shows nothing of the stem but its stops.

    :param r1: stem residual, 0 where what is allowed for at a stop hides it, NaN: not testable.
    :raises LearningError: where it does everywhere.
    """
    if not np.any(r1[np.isfinite(r1)] != 0.0):
        raise LearningError(
            'the stem was at an end of its stroke, or had been within a minute, all the time: '
            'record some minutes in which it is in between'
        )


def check_stem(fit: StemFit, cv: Floats, x: Floats) -> None:
    """
    Refuse a stem that does not follow its command.

    :param fit: what was identified.
    :param cv: command; x position.
    :raises LearningError: saying what does not fit.
    """
    asked = float(np.quantile(cv, 0.99) - np.quantile(cv, 0.01))
    if not fit.gain_error <= UNKNOWN_GAIN:
        raise LearningError(
            f'CV travelled over {asked:.3f} of the stroke only, too little to see that the stem '
            'follows it: learn while the valve works'
        )
    # on its way, a stem of a smaller gain moves as one of a lower rate does
    slack = max(GAIN, SIGMAS * fit.gain_error, SIGMAS * fit.arrived_error)
    if abs(fit.gain - 1.0) > slack and not _too_quick(fit, cv, x):
        raise LearningError(
            f'{UNLIKE}: the stem moves by {fit.gain:.2f} of what CV asks (1 expected): stuck, '
            'bent feedback or a wrong scale; mend it or check the units'
        )
    off = float(np.median(x - cv))
    if abs(off) > OFFSET:
        raise LearningError(
            f'{UNLIKE}: the stem stands {off:+.2f} of the stroke off its command; mend it or '
            'check the scale of X'
        )


def _too_quick(fit: StemFit, cv: Floats, x: Floats) -> bool:
    """
    Tell whether the samples are too rare to show the gain.

    A command that changes between the samples takes away from a fitted gain, but then the law
    leaves much unexplained, while the stem reaches as far as CV does.
    """
    asked, done = (float(np.quantile(v, 0.9) - np.quantile(v, 0.1)) for v in (cv, x))
    unexplained = fit.sigma > UNEXPLAINED * spread_of(x)
    return unexplained and fit.gain > UNRELATED and abs(done - asked) <= REACH * asked


def check_flow(ref: Reference, settings: ScadaSettings) -> None:
    """
    Refuse a flow that the stated valve coefficient cannot give.

    :param ref: record of `REFERENCE` with its flow law.
    :param settings: whether the coefficient was stated.
    :raises LearningError: saying what was found.
    """
    if settings.kv_stated and ref.flow_kind == LAW and abs(float(ref.g1) - 1.0) > FLOW_GAIN:
        raise LearningError(
            f'{UNLIKE}: the flow is {float(ref.g1):.2f} of '
            f'that of the stated Kv {settings.actuator.kv:g}; mend valve or meter, or state what '
            'the valve is'
        )
