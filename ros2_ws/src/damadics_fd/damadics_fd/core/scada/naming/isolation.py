# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Name the fault: one-parameter models of every fault fitted to both residuals since the onset.

Each hypothesis predicts X' (reduced model with the fault's block) and F' (valve equation with the
fault's law) from one strength. Its cost is the log-likelihood of both with unknown error variance,
bounded below by what the fault-free record shows; the smallest cost ranks first.
"""

import math
from dataclasses import replace

import numpy as np

from damadics_fd.core.scada.judging.cusum import P1, P2, PROCESS, R1, R2, T1, TESTS
from damadics_fd.core.scada.laws.actuator import T_RANGE
from damadics_fd.core.scada.model import FAULTS, STEM, STEM_FAULTS
from damadics_fd.core.scada.naming.errors import flow_error, stem_error
from damadics_fd.core.scada.naming.names import (
    EQUAL,
    GROUPS,
    NAMES,
    TOLD_BY_FLOW,
    Hypothesis,
    Isolation,
    group_of,
)
from damadics_fd.core.scada.naming.signs import signs
from damadics_fd.core.scada.naming.witness import by_witnesses
from damadics_fd.core.scada.settings import ScadaConfig
from damadics_fd.core.scada.state import (
    HISTORY_LENGTH,
    LAW,
    MonitorState,
    Reference,
)

__all__ = ['GROUPS', 'NAMES', 'Hypothesis', 'Isolation', 'Isolator', 'group_of']

WINDOW = 600  # samples at most
FIRST = 240  # of them for the coarse search
SHORTEST = 5
LINGERS_S = 3.0  # after the last evidence the record still tells of the fault
MINIMUM_ERROR = 1e-12
INCIPIENT_ONLY = frozenset({3, 4, 5, 6, 9})  # no physical background as abrupt faults
PROCESS_FIRST_S = 3.0
FLOW_END, MOSTLY = 0.97, 0.9  # of the meter's range; share of the samples that show it
ABRUPT_PRIOR = 8.0  # nats against them after an abrupt onset
SEAT = frozenset({2, 3})  # they move the stem by less than its model is known
TWO_SIDED = frozenset({12, 13, 19})
HYPOTHESES = tuple(n for n in NAMES if n not in (7, 17))
GRID = (0.03, 0.15, 0.35, 0.6, 0.85)
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
REFINED = 6  # hypotheses whose strength is refined


def last_evidence(state: MonitorState) -> float:
    """Return until when the record tells of the present fault, s."""
    return float(state.t_evidence) + LINGERS_S


def misfit(error: float, variance: float) -> float:
    """
    Return the cost of a mean squared error, per half a sample, nats.

    Above the variance of the fault-free record that of an unknown variance, below it that of the
    known one: there, too, less error is a better explanation.

    >>> misfit(1.0, 1.0), round(misfit(2.0, 1.0), 3), misfit(0.5, 1.0)
    (0.0, 0.693, -0.5)
    """
    ratio = max(error, MINIMUM_ERROR) / max(variance, MINIMUM_ERROR)
    return math.log(ratio) if ratio > 1.0 else ratio - 1.0


def occam(fault: int, rise: float, step: float) -> float:
    """
    Return what a strength costs that had to be found among all that were possible, nats.

    All strengths are equally likely before. A fault of which only few would do (a hundredth of
    its range, say) had to be lucky to explain the record; one of which many would do had not.

    :param fault: number of the fault.
    :param rise: of the cost from the best strength to a step on either side, sum of both, nats.
    :param step: the step.

    >>> round(occam(2, 1.0, 0.01), 1), round(occam(19, 1.0, 0.01), 1), occam(2, 0.0, 0.01)
    (3.7, 4.4, 0.0)
    """
    reach = 2.0 if fault in TWO_SIDED else 1.0
    if not rise > 0.0:
        return 0.0
    width = math.sqrt(2.0 * math.pi / rise) * step
    return max(math.log(reach / width), 0.0)


class Isolator:
    """
    Rank the faults for one monitor.

    :param settings: record of `SETTINGS`.
    :param reference: record of `REFERENCE`.
    """

    def __init__(self, settings: ScadaConfig, reference: Reference) -> None:
        self._act = settings.act
        self._ref = reference
        self._stem = np.zeros(1, STEM)
        tests = [test.residual for test in TESTS]
        self._mean_t1 = float(reference.mu[tests.index(T1)])
        self._nominal = (math.nan, math.nan)
        self._late = False
        self._alike = float(reference.kap2)  # so many neighbouring errors tell as much as one
        self._bias = float(np.max((reference.se * reference.sd)[np.equal(tests, R1)]))
        self._variance = (
            float(reference.s1) ** 2,
            float(reference.sd[tests.index(R2)]) ** 2 or 1.0,
        )

    def isolate(self, state: MonitorState, abrupt: bool | None = None) -> Isolation | None:
        """
        Rank the faults after an alarm.

        :param state: record of the monitor, with the alarm's onset.
        :param abrupt: whether the fault came at once; by default from the test that fired.
        :return: the ranking; None where there is no alarm or too short a record yet.
        """
        if not state.alarm:
            return None
        window = self._window(state)
        if len(window) < SHORTEST:
            return None
        ref = self._ref
        if ref.stem_kind == LAW or ref.flow_kind == LAW:
            return replace(by_witnesses(state, ref, window), signs=signs(state, ref, window))
        if abrupt is None:
            test = int(state.test)
            abrupt = test < len(TESTS) and TESTS[test].k0 >= 1.5
        shown = self._inputs(state, window)
        part = window[:FIRST]
        self._nominal = self._errors(part, None, None)
        coarse = {fault: self._grid(part, fault) for fault in HYPOTHESES}
        order = sorted(HYPOTHESES, key=lambda fault: min(coarse[fault])[0])
        self._nominal = self._errors(window, None, None)
        ranking = [self._refine(window, fault, coarse[fault]) for fault in order[:REFINED]]
        for fault in order[REFINED:]:
            strength = min(coarse[fault])[1]
            ranking.append(Hypothesis(fault, strength, self.cost(window, fault, strength)))
        if abrupt:
            ranking = [
                Hypothesis(h.fault, h.strength, h.cost + ABRUPT_PRIOR)
                if h.fault in INCIPIENT_ONLY
                else h
                for h in ranking
            ]
        ranking.sort(key=lambda h: h.cost)
        if shown:
            best = ranking[0].cost
            shown = [Hypothesis(h.fault, h.strength, best - 10.0 * EQUAL) for h in shown]
        told = signs(state, ref, window)
        ended = float(np.mean(window['flow'] >= FLOW_END)) > MOSTLY
        return Isolation(float(state.t), len(window), (*shown, *ranking), told, ended)

    def _window(self, state: MonitorState) -> np.ndarray:
        count = int(state.samples)
        kept = min(count, HISTORY_LENGTH)
        order = np.arange(count - kept, count) % HISTORY_LENGTH
        window = np.asarray(state.history)[order]
        window = window[(window['t'] > state.t_onset) & (window['t'] <= last_evidence(state))]
        self._late = len(window) > WINDOW
        return np.ascontiguousarray(window[-WINDOW:])

    def _inputs(self, state: MonitorState, window: np.ndarray) -> list[Hypothesis]:
        """Return f7 or f17 where the inputs themselves show them."""
        fired = {
            test.residual
            for i, test in enumerate(TESTS)
            if test.residual >= P1 and state.ratios[i] >= 1.0
        }
        p1, p2 = (float(self._ref.pressure[i].mean) for i in range(2))
        first = state.t_shown[PROCESS]  # NaN: it did not show
        if first <= np.nanmin([*state.t_shown, math.inf]) + PROCESS_FIRST_S:
            return [Hypothesis(17, math.nan, 0.0)]
        if T1 in fired:
            shift = T_RANGE * float(np.nanmean(window['t1']) - self._mean_t1)
            if shift > 0.0:
                return [Hypothesis(7, min(max((shift - 200.0) / 100.0, 0.0), 1.0), 0.0)]
        if P2 in fired and P1 not in fired:
            return [Hypothesis(17, 1.0 - float(np.mean(window['p2'])) / p2, 0.0)]
        if P1 in fired:
            return [Hypothesis(17, float(np.mean(window['p1'])) / p1 - 1.0, 0.0)]
        return []

    def _errors(
        self, window: np.ndarray, stem: np.ndarray | None, flow: np.ndarray | None
    ) -> tuple[float, float]:
        """Return the mean squared errors of X' and F'; the nominal ones where no fault acts."""
        nominal = np.zeros(1, FAULTS)
        if stem is not None or flow is None:
            faults = nominal if stem is None else stem
            of_stem = stem_error(
                window, self._act, faults[0], self._stem[0], self._late, self._bias
            )
        else:
            of_stem = self._nominal[0]
        if flow is not None or stem is None:
            faults = nominal if flow is None else flow
            g0, g1 = self._ref.g0, self._ref.g1
            of_flow = flow_error(window, self._act, faults[0], g0, g1)
        else:
            of_flow = self._nominal[1]
        return float(of_stem), float(of_flow)

    def cost(self, window: np.ndarray, fault: int, strength: float) -> float:
        """
        Return the cost of one fault at one strength.

        :param window: rows of `HISTORY`.
        :param fault: number of the fault; strength as the benchmark defines it.
        :return: nats.
        """
        faults = np.zeros(1, FAULTS)
        faults[f'f{fault}'] = strength
        stem, flow = self._errors(
            window,
            faults if fault in STEM_FAULTS else None,
            faults if fault in TOLD_BY_FLOW else None,
        )
        if fault in SEAT:
            stem = min(stem, self._nominal[0])
        n = 0.5 * len(window)
        total = n * misfit(stem, self._variance[0]) / self._alike
        if not math.isnan(flow):
            total += n * misfit(flow, self._variance[1])
        return total

    def _grid(self, window: np.ndarray, fault: int) -> list[tuple[float, float]]:
        """Return cost and strength on a coarse grid."""
        grid = [0.0, *GRID, 1.0]
        if fault in TWO_SIDED:
            grid = [*(-g for g in reversed(grid)), *grid[1:]]
        if fault == 13:
            grid = [g for g in grid if g > -0.7]  # X' stays positive
        if fault == 15:  # a play as wide as the motion: the cost has several minima
            grid = [0.1 * i for i in range(11)]
        if fault == 1:  # shows only where the stem meets its stop
            reached = 1.0 - float(np.quantile(window['x'], 0.98))
            grid = sorted({*grid, *(min(max(reached + d, 0.0), 1.0) for d in (-0.02, 0.0, 0.02))})
        return [(self.cost(window, fault, strength), strength) for strength in grid]

    def _refine(
        self, window: np.ndarray, fault: int, grid: list[tuple[float, float]]
    ) -> Hypothesis:
        """Refine the best strength by golden section between its neighbours on the grid."""
        i = grid.index(min(grid))
        low, high = grid[max(i - 1, 0)][1], grid[min(i + 1, len(grid) - 1)][1]
        best = (self.cost(window, fault, grid[i][1]), grid[i][1])
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        at_left = self.cost(window, fault, left)
        at_right = self.cost(window, fault, right)
        for _ in range(8 if fault in STEM_FAULTS else 20):  # the flow's laws cost next to nothing
            best = min(best, (at_left, left), (at_right, right))
            if at_left < at_right:
                high, right, at_right = right, left, at_left
                left = high - GOLDEN * (high - low)
                at_left = self.cost(window, fault, left)
            else:
                low, left, at_left = left, right, at_right
                right = low + GOLDEN * (high - low)
                at_right = self.cost(window, fault, right)
        cost, strength = min(best, (at_left, left), (at_right, right))
        step = max(high - low, 1e-4)
        around = [self.cost(window, fault, strength + side) for side in (-step, step)]
        return Hypothesis(fault, strength, cost + occam(fault, sum(around) - 2.0 * cost, step))
