# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Identify a valve for mode scada from fault-free recordings of any number of days."""

import math
from collections.abc import Collection, Sequence

import numpy as np

from damadics_fd.core.record import Plain
from damadics_fd.core.scada.estimator import scada_settings
from damadics_fd.core.scada.judging.residuals import (
    DOUBT,
    FLOW_HOURS,
    HOURS_S,
    STEM_HOURS,
    STEM_LASTING,
)
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE
from damadics_fd.core.scada.laws.clean import period_of
from damadics_fd.core.scada.laws.flow_law import GAS
from damadics_fd.core.scada.laws.robust import Floats
from damadics_fd.core.scada.laws.stem_law import FAST
from damadics_fd.core.scada.learning import LearningError, learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.samples import scada_samples
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import LAW, Reference
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import LIMITED, OK, REFUSED, FaultFree, Identified

BETWEEN_S = 3600.0  # set between recordings, so that none runs on into the next
NAMES = ('t', 'cv', 'x1', 'p1', 'p2', 't1', 'flow')
SLOW_S = 5.0  # sample period from which fast faults of the stem are not seen
NARROW = 0.1  # of the stroke


def identify(
    recordings: Sequence[FaultFree], sheet: Settings, given: Collection[str] = ()
) -> Identified:
    """
    Identify stem and flow of a valve.

    :param recordings: of one valve, fault-free.
    :param sheet: settings of mode scada with what the data sheet says.
    :param given: names of the settings that the user stated.
    :return: settings, report, verdict and what was learned.
    """
    samples = pooled(recordings)
    period = period_of(samples[:, 0])
    changes: dict[str, Plain] = {}
    if 'sample_rate' not in given:
        changes['sample_rate'] = 1.0 / max(period, 1.0)
    if 'gap_reset' not in given and 5.0 * period > sheet.gap_reset:
        changes['gap_reset'] = 5.0 * period
    highest = float(np.nanmax(samples[:, 3:5], initial=0.0)) * P_RANGE
    if 'p_max' not in given and highest > 0.9 * sheet.p_max:
        changes['p_max'] = round(1.25 * highest, -4)
    settings = sheet.replace(**changes)
    notes: list[str] = []
    own = scada_settings(settings, kv_stated='kv' in given)
    try:
        reference = learn(samples, own, math.inf, notes)
    except LearningError as problem:
        return Identified(REFUSED, changes, (f'refused: {problem}',), (str(problem),))
    report = [
        f'{len(samples)} samples of {len(recordings)} recordings, every {period:g} s',
        *_stem(reference),
        *_flow(reference, settings, notes),
    ]
    missed = _missed(reference, period) + _second_half(samples, own)
    verdict = LIMITED if missed else OK
    report += [*(f'limited: {text}' for text in missed), f'verdict: {verdict}']
    return Identified(verdict, changes, tuple(report), tuple(missed), Reference.plain(reference))


def _second_half(samples: Floats, settings: ScadaSettings) -> list[str]:
    """Learn from the first half and watch the second: say what that raises."""
    half = len(samples) // 2
    try:
        reference = learn(samples[:half], settings, math.inf)
    except LearningError as problem:
        return [f'the first half alone is not enough to check what was learned: {problem}']
    monitor = ScadaMonitor(settings, reference)
    monitor.run_samples(samples[half:])
    alarms = int(monitor.state.occurrence)
    if not alarms:
        return []
    return [
        f'learned from the first half, the second raises {alarms} alarms: a fault in it, or loads '
        'that the first does not show'
    ]


def pooled(recordings: Sequence[FaultFree]) -> Floats:
    """
    Return the samples of all recordings as one record with gaps, thinned to one a second.

    :param recordings: in the order in which they are to follow each other.
    """
    parts: list[Floats] = []
    end = 0.0
    for recording in recordings:
        rows = scada_samples(recording.columns)
        rows = rows[np.isfinite(rows[:, :3]).all(axis=1)]
        rows = rows[np.r_[True, np.diff(rows[:, 0]) > 0.0]]
        every = max(int(round(1.0 / period_of(rows[:, 0]))), 1)
        rows = rows[::every]
        if parts and rows[0, 0] < end:
            rows[:, 0] += end + BETWEEN_S - rows[0, 0]
        end = float(rows[-1, 0])
        parts.append(rows)
    return np.concatenate(parts)


def unseen(reference: np.ndarray) -> float:
    """Return which part of a plant's slow changes the recordings were too short to show."""
    return math.sqrt(HOURS_S / (HOURS_S + float(reference['seconds'][0])))


def _stem(reference: np.ndarray) -> list[str]:
    """Tell what the stem does and which deviation of it is found."""
    law, ref = reference['stem_law'][0], reference[0]
    rates = [
        f'{name} at {law[field]:.3f} of the stroke/s'
        for name, field in (('closes', 'rise'), ('opens', 'fall'))
        if law[field] < FAST
    ]
    kind = 'identified law' if ref['stem_kind'] == LAW else 'the stated actuator'
    sigma = float(ref['sd'][1])
    least = 2.0 * sigma
    if ref['stem_kind'] == LAW:
        least += DOUBT * (STEM_HOURS + STEM_LASTING) * unseen(reference)
    return [
        f'stem: {kind}; dead time {law["dead_s"]:.1f} s, lag {law["lag_s"]:.1f} s, gain '
        f'{law["gain"]:.3f}' + ''.join(f', {text}' for text in rates),
        f'stem: learned at X {ref["low"][2]:.2f}..{ref["high"][2]:.2f}, noise {sigma:.4f} of the '
        f'stroke; found within a minute: {least:.3f} of the stroke off its command',
    ]


def _flow(reference: np.ndarray, settings: Settings, notes: Sequence[str]) -> list[str]:
    """Tell what the flow does and which deviation of it is found."""
    ref = reference[0]
    law = ref['flow_law']
    if not ref['flow_max'] > 0.0 or (ref['flow_kind'] == LAW and not law['spread'] > 0.0):
        return ['flow: not judged']
    if ref['flow_kind'] != LAW:
        return [
            f'flow: as the stated Kv {settings.kv:g} gives, times {ref["g1"]:.3f}; a change by '
            '2 % is found within minutes'
        ]
    medium = 'gas or steam' if law['medium'] == GAS else 'liquid'
    steps = ', '.join(f'{math.exp(c - law["c"][0]):.3f}' for c in law['c'])
    hours = FLOW_HOURS * unseen(reference)
    least = 100.0 * (math.exp(DOUBT * hours + 4.0 * float(law['spread'])) - 1.0)
    lines = [
        f'flow: {medium}, identified: share of the open capacity at X 0, 0.1 .. 1: {steps}',
        f'flow: {"; ".join(notes)}; found within 5 samples: {least:.0f} % off',
    ]
    if law['medium'] != GAS:
        kv = math.exp(float(law['c'][0])) * F_RANGE / 1e-4
        lines.append(f'flow: Kv {kv:.0f} when open, {kv / settings.kv:.2f} of {settings.kv:g}')
    return lines


def _missed(reference: np.ndarray, period: float) -> list[str]:
    """Return what will not be found, and why."""
    ref = reference[0]
    measured = [bool(int(ref['signals']) >> i & 1) for i in range(7)]
    missed = []
    if not (measured[3] and measured[4]):
        missed.append('P1 or P2 is not measured: no flow test, f17 is not found')
    elif not measured[6]:
        missed.append('the flow is not measured: f2, f3, f5, f6, f18, f19 are not found')
    if period > SLOW_S:
        missed.append(
            f'a sample every {period:g} s does not show how the stem moves: f4, f11, f12 are '
            'found by what lasts only'
        )
    if float(ref['high'][2] - ref['low'][2]) < NARROW:
        missed.append(
            'the stem moved over less than a tenth of its stroke: elsewhere only large deviations '
            'are found; add recordings with other loads'
        )
    return missed
