# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Performance indices of the DAMADICS benchmark definition v1.0, appendix II.

A decision signal is sampled at ascending instants and holds its value until the next one. Times
are seconds from the start of the file. An index that the definition leaves undefined is NaN;
the option `picalc` follows the PICalc block of DABLib instead, which writes -1.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

T_ON = 300.0
T_FROM = 900.0
T_OVER = 600.0
PICALC_THRESHOLD = 0.5
PICALC_MINIMUM_T_DT = 0.5


@dataclass(frozen=True)
class Zones:
    """
    Time zones of one scenario (table 1 of the definition), in seconds from file start.

    :param t_on: end of the set-up zone.
    :param t_from: start of the fault.
    :param t_hor: time horizon; nothing after it counts.
    :param t_to: end of the fault, infinite where it stays.
    """

    t_on: float = T_ON
    t_from: float = T_FROM
    t_hor: float = T_FROM + T_OVER
    t_to: float = math.inf

    def __post_init__(self) -> None:
        """Refuse zones in the wrong order."""
        if not self.t_on < self.t_from < self.t_hor:
            raise ValueError(
                f't_on {self.t_on}, t_from {self.t_from}, t_hor {self.t_hor}: give them ascending'
            )

    @classmethod
    def of_development(cls, t_fd: float) -> 'Zones':
        """
        Return the zones of a standard scenario.

        :param t_fd: fault development time, s; 0 for an abrupt fault.
        :return: t_hor = t_from + t_fd + 600 s.
        """
        return cls(t_hor=T_FROM + t_fd + T_OVER)


@dataclass(frozen=True)
class DecisionIndices:
    """
    Indices of one binary decision signal; t_dt .. f_sd for DD, t_it .. f_si for PID.

    :param t_dt: from t_from to the last leading edge, s.
    :param t_dm: moment of that edge from file start, s.
    :param t_drt: from t_to to the last falling edge, s.
    :param t_drm: moment of that edge from file start, s.
    :param r_fd: false decision rate in [t_on, t_from].
    :param r_td: true decision rate in [t_from, t_hor].
    :param f_sd: fault strength at the last leading edge.
    :param permanent: whether the decision is high at the end of the horizon.
    """

    t_dt: float
    t_dm: float
    t_drt: float
    t_drm: float
    r_fd: float
    r_td: float
    f_sd: float
    permanent: bool

    def as_isolation(self) -> dict[str, float | bool]:
        """Return the same figures under the names of the isolation twins."""
        twin = {
            't_dt': 't_it',
            't_dm': 't_im',
            't_drt': 't_irt',
            't_drm': 't_irm',
            'r_fd': 'r_fi',
            'r_td': 'r_ti',
            'f_sd': 'f_si',
        }
        return {twin.get(name, name): value for name, value in asdict(self).items()}


def high_time(t: ArrayLike, decision: ArrayLike, start: float, end: float) -> float:
    """
    Return the time a held binary signal is high within [start, end].

    :param t: sample instants, ascending, s, shape (n,).
    :param decision: truth values, shape (n,).
    :return: seconds.

    >>> high_time([0, 1, 2, 3], [0, 1, 0, 1], 0.5, 3.5)
    1.5
    """
    instants = np.asarray(t, dtype=np.float64)
    until = np.append(instants[1:], max(end, instants[-1]))
    held = np.minimum(until, end) - np.maximum(instants, start)
    return float(np.clip(held, 0.0, None)[np.asarray(decision, dtype=bool)].sum())


def decision_indices(
    t: ArrayLike,
    decision: ArrayLike,
    zones: Zones,
    strength: ArrayLike | None = None,
    *,
    picalc: bool = False,
) -> DecisionIndices:
    """
    Return the indices of DD (or of PID) over one scenario (appendix II).

    Only leading edges inside [t_from, t_hor] detect the fault. A decision that is high before
    the fault and never falls has no such edge: t_dt is undefined and r_fd shows the false alarm.

    :param t: sample instants, ascending, s, shape (n,).
    :param decision: decision signal, shape (n,); true above 0.5.
    :param zones: time zones of the scenario.
    :param strength: fault strength f_s, shape (n,); NaN indices of strength where absent.
    :param picalc: follow the PICalc block: t_from and t_to from the first and last non-zero
        strength, r_fd also over [t_to, t_hor], no true detection unless t_dt >= 0.5 s, and -1
        for undefined.
    :return: the indices.
    :raises ValueError: for signals of unequal length or instants that do not ascend.
    """
    instants = np.asarray(t, dtype=np.float64)
    high = np.asarray(decision, dtype=np.float64) > PICALC_THRESHOLD
    if instants.shape != high.shape or instants.ndim != 1 or not instants.size:
        raise ValueError(f't has shape {instants.shape}, decision {high.shape}: give one per t')
    if np.any(np.diff(instants) <= 0):
        raise ValueError('t does not ascend: sort the samples by time first')
    f_s = None if strength is None else np.asarray(strength, dtype=np.float64)
    if f_s is not None and f_s.shape != instants.shape:
        raise ValueError(f'strength has shape {f_s.shape}, t {instants.shape}: give one per t')
    t_from, t_to = zones.t_from, zones.t_to
    if picalc and f_s is not None and np.any(f_s != 0):
        t_from, t_to = _fault_interval(instants, f_s)

    before = np.concatenate(([False], high[:-1]))
    in_horizon = instants <= zones.t_hor
    leading = np.flatnonzero(high & ~before & in_horizon & (instants >= t_from))
    falling = np.flatnonzero(~high & before & in_horizon & (instants >= t_from))
    t_dm = float(instants[leading[-1]]) if leading.size else math.nan
    t_drm = float(instants[falling[-1]]) if falling.size else math.nan
    f_sd = float(f_s[leading[-1]]) if leading.size and f_s is not None else math.nan
    last = np.flatnonzero(in_horizon)
    t_dt = t_dm - t_from

    fault_free = t_from - zones.t_on
    false_time = high_time(instants, high, zones.t_on, t_from)
    true_end = zones.t_hor
    if picalc and t_to < zones.t_hor:
        fault_free += zones.t_hor - t_to
        false_time += high_time(instants, high, t_to, zones.t_hor)
        true_end = t_to
    r_td = high_time(instants, high, t_from, true_end) / (zones.t_hor - t_from)
    if picalc and not t_dt >= PICALC_MINIMUM_T_DT:
        r_td = 0.0
    undefined = -1.0 if picalc else math.nan

    def defined(value: float) -> float:
        return value if math.isfinite(value) else undefined

    return DecisionIndices(
        t_dt=defined(t_dt),
        t_dm=defined(t_dm),
        t_drt=defined(t_drm - t_to),
        t_drm=defined(t_drm),
        r_fd=false_time / fault_free,
        r_td=r_td,
        f_sd=defined(f_sd),
        permanent=bool(last.size and high[last[-1]]),
    )


def _fault_interval(t: NDArray[np.float64], f_s: NDArray[np.float64]) -> tuple[float, float]:
    present = np.flatnonzero(f_s != 0)
    end = present[-1] + 1
    return float(t[present[0]]), float(t[end]) if end < t.size else math.inf


def misisolation_rate(t: ArrayLike, complementary: ArrayLike, zones: Zones) -> float:
    """
    Return r_mi, the time share of the complementary isolation decision CID in [t_on, t_hor].

    :param t: sample instants, ascending, s, shape (n,).
    :param complementary: CID, true where a wrong fault is named, shape (n,).
    :param zones: time zones of the scenario.
    :return: share, 0..1.
    """
    return high_time(t, complementary, zones.t_on, zones.t_hor) / (zones.t_hor - zones.t_on)


def diagnosis_accuracy(diagnoses: Sequence[Sequence[int]], true_fault: int) -> tuple[float, float]:
    """
    Return dacc_tm and dacc of a sequence of elementary diagnoses.

    :param diagnoses: per sample the faults named; an empty one (or 0, OK) names none.
    :param true_fault: number of the fault; 0 for a fault-free record.
    :return: dacc_tm, the mean of 1/L over the diagnoses that name the fault among L (0 for the
        others), and dacc, 1/L of the last diagnosis if the true one is permanent there, else 0.

    >>> diagnosis_accuracy([[4, 11], [4], [4]], 4)
    (0.8333333333333334, 1.0)
    """

    def accuracy(named: Sequence[int]) -> float:
        faults = set(named) or {0}
        return 1.0 / len(faults) if true_fault in faults else 0.0

    each = [accuracy(named) for named in diagnoses]
    return (sum(each) / len(each), each[-1]) if each else (0.0, 0.0)
