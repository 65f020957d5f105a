# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Name the fault of a valve whose actuator is not known, by witnesses.

Which residuals show it, which way, in which order, and what the process does meanwhile:

- A pressure that moves against the flow, before anything else does: the pressures (f17).
- The flow too high for position and pressures, the stem as commanded: a bypass (f18) or the meter
  (f19). A bypass takes pressure off the valve, a meter does not, at first.
- The stem away from its command while the flow follows the stem: actuator or positioner. Without
  air the spring takes the stem to its rest (f16); a stem that stands still is stuck (f4); one that
  ends at a place it cannot pass is blocked (f1).
- Stem and flow at once, as if the position were another: the position sensor (f13).
"""

import math
from collections.abc import Callable

import numpy as np

from damadics_fd.core.scada.judging.cusum import PROCESS, R1, R2
from damadics_fd.core.scada.laws.robust import spread_of
from damadics_fd.core.scada.naming.names import Hypothesis, Isolation
from damadics_fd.core.scada.state import MonitorState, Reference

FIRST_S = 6.0  # what comes within this time of the first sign comes first
CLEAR = 8.0  # nats for a witness that hardly errs
GOOD = 5.0
FAIR = 2.5
MOVED_DROP = 0.12  # of log dP: a pressure drop that changed
STILL = 0.25  # share of the model's motion below which a stem stands still
STILL_AWAY = 0.7  # share of the largest deviation
RESTING = 0.03  # of the stroke, from its rest
STEM_FAULTS = (1, 4, 9, 10, 11, 12, 13, 15, 16)
FLOW_FAULTS = (2, 3, 5, 6, 13, 18, 19)


def by_witnesses(state: MonitorState, ref: Reference, window: np.ndarray) -> Isolation:
    """
    Rank the faults by what witnesses say, nats for and against.

    :param state: record of the monitor.
    :param ref: record of `REFERENCE`.
    :param window: rows of `HISTORY` since the onset, while the fault shows.
    :return: the ranking.
    """
    score = dict.fromkeys((*STEM_FAULTS, *FLOW_FAULTS, 17), 0.0)
    shown = np.array(state.t_shown, float)
    first = np.nanmin(shown) if np.isfinite(shown).any() else math.nan

    def early(residual: int) -> bool:
        return bool(shown[residual] <= first + FIRST_S)

    stem, flow = bool(np.isfinite(shown[R1])), bool(np.isfinite(shown[R2]))
    _process(score, state, shown, early)
    if early(R2) and not (stem and early(R1)):
        _flow(score, state, ref, window)
    elif early(R1):
        _stem(score, state, ref, window)
        if flow and early(R2) and state.sign[R1] == state.sign[R2]:
            score[13] += (
                CLEAR  # X' reads too far closed and the flow is too high for it, or both not
            )
        elif not math.isnan(float(ref.f_mean)) and ref.flow_max > 0.0:
            score[13] -= FAIR  # the flow would not follow a position that only the sensor shows
    ranking = sorted(
        (Hypothesis(fault, math.nan, -value) for fault, value in score.items()),
        key=lambda h: (h.cost, h.fault),
    )
    return Isolation(float(window['t'][-1]), len(window), tuple(ranking))


def _process(
    score: dict[int, float], state: MonitorState, shown: np.ndarray, early: Callable[[int], bool]
) -> None:
    """Judge pressures that move by themselves."""
    if not math.isnan(float(shown[PROCESS])) and early(PROCESS):
        against = state.sign[R2] > 0.0 and early(R2)
        score[17] += FAIR if against else CLEAR + GOOD
    else:
        score[17] -= FAIR


def _flow(
    score: dict[int, float], state: MonitorState, ref: Reference, window: np.ndarray
) -> None:
    """Judge a flow that does not fit position and pressures while the stem obeys."""
    for fault in FLOW_FAULTS:
        score[fault] += GOOD
    up = state.sign[R2] > 0.0
    for fault in (3, 6, 18) if up else (2, 5):
        score[fault] += FAIR
    score[19] += FAIR
    for fault in (2, 5) if up else (3, 6, 18):
        score[fault] -= CLEAR
    score[13] += FAIR * 0.5  # a positioner follows its sensor at once: the stem shows little
    abrupt = float(state.t_raised - state.t_onset) < 60.0
    if abrupt:
        for fault in (2, 3, 5, 6):
            score[fault] -= GOOD  # wear grows slowly
    change = drop_change(ref, state, window)
    moved = float(np.ptp(window['x'][: _few(window)]))
    if up and change < -MOVED_DROP and moved < 0.05:
        score[18] += GOOD
        score[19] -= FAIR * 0.5
    elif up and abs(change) < 0.5 * MOVED_DROP:
        score[19] += FAIR * 0.5


def _few(window: np.ndarray) -> int:
    """Return how many rows the first moments of a fault are."""
    return max(int(np.searchsorted(window['t'], window['t'][0] + 15.0)), 3)


def drop_change(ref: Reference, state: MonitorState, window: np.ndarray) -> float:
    """Return the change of log(P1 - P2) in the first moments against the level before."""
    before = float(state.level_before[0] - state.level_before[1])
    part = window[: _few(window)]
    drop = part['p1'] - part['p2']
    drop = drop[np.isfinite(drop)]
    if not drop.size or not before > 0.0:
        return math.nan
    least = max(float(np.min(drop)), 1e-3 * before)
    return math.log(least / before)


def _stem(
    score: dict[int, float], state: MonitorState, ref: Reference, window: np.ndarray
) -> None:
    """Judge a stem that is not where its command asks while the flow fits the stem."""
    for fault in STEM_FAULTS:
        score[fault] += FAIR
    # what the stem does on its way back belongs to the repair, not to the fault
    size = np.abs(window['r1'])
    away = np.flatnonzero(size >= STILL_AWAY * np.max(size))
    window = window[: int(away[-1]) + 1]
    x, xm = window['x'], window['xm']
    opening = state.sign[R1] < 0.0
    # stiff: the model moves, the stem does not
    asked, done = spread_of(xm), spread_of(x)
    sigma = float(ref.stem_law.gain and ref.sd[0])
    if asked > 3.0 * sigma and done < STILL * asked:
        score[4] += CLEAR
        score[1] += CLEAR if opening else 0.0
        score[15] += FAIR
    toward = float(x[-1] - x[0])
    command = float(xm[-1] - xm[0])
    rest = float(np.min(x))
    if opening and toward < -3.0 * sigma and toward < command - 3.0 * sigma:
        # it leaves its command for the spring's rest
        score[16] += CLEAR if rest < RESTING else GOOD
        score[10] += GOOD - 1.0  # a hole in the diaphragm is rarer than a loss of air
        score[9] += FAIR
    elif opening:
        score[12] += FAIR
        score[9] += FAIR
    else:
        score[11] += FAIR
        score[12] += FAIR
        score[15] += FAIR
        score[16] -= FAIR
