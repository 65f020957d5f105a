# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The paper's experiments, and the comparison of a recorded run with the paper."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from damadics_fd.bag.columns import read_columns
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.monitor import Chain
from damadics_fd.core.record import Json, Plain
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings

FAST = ('/measurement', '/fault_state', '/estimate', '/residual', '/threshold')
ONSET = 70.0  # s, of both faults
SECONDS = 120.0  # length of each experiment
PASSES = 2  # of the fault-free experiment that are learned: docs/theory.md says why two
Learned = Mapping[str, Plain]  # what a reference keeps of the estimator


@dataclass(frozen=True)
class Experiment:
    """One experiment of the paper (section 5)."""

    name: str
    scenario: str
    title: str
    paper: float | None  # detection instant in print [s], None: no fault


NOMINAL = Experiment('nominal', 'paper_nominal', 'Fault-free run', None)
EXPERIMENTS = (
    NOMINAL,
    Experiment('friction', 'paper_friction', 'Incipient friction fault (Fig. 5)', 81.12),
    Experiment('spring', 'paper_spring', 'Abrupt spring fault (Fig. 6)', 70.005),
)


@dataclass(frozen=True)
class Decisions:
    """When a fault was decided in one run, by the two-sample rule."""

    flags: list[float]  # instants at which the flag rose, the second sample each [s]
    exceeds_at: float | None  # first sample over the threshold of the first decision from ONSET on

    @property
    def before_fault(self) -> list[float]:
        """Decisions before the fault's onset [s]."""
        return [t for t in self.flags if t < ONSET]

    @property
    def detected_at(self) -> float | None:
        """When the flag rose for the fault [s]."""
        return next((t for t in self.flags if t >= ONSET), None)

    def agrees(self, experiment: Experiment) -> bool:
        """Tell whether one of the two samples is the instant in print, or nothing is decided."""
        if experiment.paper is None:
            return not self.flags
        instants = [t for t in (self.exceeds_at, self.detected_at) if t is not None]
        return any(abs(t - experiment.paper) < 1e-6 for t in instants)

    def as_dict(self, experiment: Experiment) -> dict[str, Json]:
        """Return the decisions for `results.json`."""
        if experiment.paper is None:
            return {'decisions': self.flags}
        return {
            'exceeds_at': self.exceeds_at,
            'detected_at': self.detected_at,
            'before_fault': self.before_fault,
        }


@dataclass(frozen=True)
class Outcome:
    """What one experiment gave: live, from its bag, and from its bag with zero weights."""

    experiment: Experiment
    live: Decisions
    offline: Decisions
    zero_start: Decisions
    samples: int
    lost: int
    identical: bool
    bag: Path
    bag_bytes: int
    figure: Path
    counts: dict[str, int] = field(default_factory=dict)

    @property
    def agrees(self) -> bool:
        """Whether the run is whole, repeatable, and decides when the paper does and only then."""
        return (
            self.live.agrees(self.experiment)
            and not self.live.before_fault
            and self.offline == self.live
            and self.identical
            and self.lost == 0
        )

    def as_dict(self) -> dict[str, Json]:
        """Return the outcome for `results.json`."""
        values = self.live.as_dict(self.experiment)
        if self.experiment.paper is not None:
            values['offline_detected_at'] = self.offline.detected_at
            values['paper_detected_at'] = self.experiment.paper
        return {
            'experiment': self.experiment.title,
            **values,
            'samples': self.samples,
            'counts': self.counts,
            'lost': self.lost,
            'identical': self.identical,
            'agrees_with_paper': self.agrees,
            'bag': str(self.bag),
            'bag_bytes': self.bag_bytes,
            'figure': str(self.figure),
        }


def judge(
    experiment: Experiment, bag: Path, learned: Learned
) -> tuple[Outcome, dict[str, np.ndarray], Result]:
    """
    Compare a recorded live run with the paper and with the off-line core.

    :param experiment: what was run.
    :param bag: its recording.
    :param learned: what the estimator began with.
    :return: the outcome, the recorded columns (with `fault` and `strength`), the off-line result.
    """
    topics = {topic: read_columns(bag, topic) for topic in FAST}
    columns = dict(topics['/measurement'])
    result = off_line(columns, learned)
    counts = {topic: len(rows['stamp']) for topic, rows in topics.items()}
    flags = raised(read_columns(bag, '/fault_event'))
    offline = decisions_of(result, columns)
    truth = topics['/fault_state']
    if np.array_equal(truth['stamp'], columns['stamp']):
        columns.update(fault=truth['fault'], strength=truth['strength'])
    recorded = topics['/residual']['data'], topics['/threshold']['data']
    outcome = Outcome(
        experiment=experiment,
        live=Decisions(flags, exceeds_at(flags, topics['/residual']['stamp'], *recorded)),
        offline=offline,
        zero_start=decisions_of(off_line(columns, None), columns),
        samples=counts['/measurement'],
        counts=counts,
        lost=lost_samples(topics),
        identical=flags == offline.flags and same_as_recorded(result, topics),
        bag=bag,
        bag_bytes=sum(path.stat().st_size for path in bag.rglob('*.mcap')),
        figure=bag.parent / f'{experiment.name}.png',
    )
    return outcome, columns, result


def off_line(columns: Mapping[str, np.ndarray], learned: Learned | None) -> Result:
    """
    Put a recording through the core in mode paper.

    :param columns: the recorded measurement.
    :param learned: what the estimator begins with; None: zero weights.
    :return: estimates and decisions.
    """
    return Chain(Settings.for_mode('paper')).starting_from(learned).run(columns)


def decisions_of(result: Result, columns: Mapping[str, np.ndarray]) -> Decisions:
    """
    Return the decisions of an off-line run.

    :param result: of the core.
    :param columns: what it was made from.
    :return: its decisions.
    """
    flags = [event.stamp * 1e-9 for event in result.detections]
    residual, threshold = (result.decisions[name] for name in ('residual', 'threshold'))
    return Decisions(flags, exceeds_at(flags, columns['stamp'], residual, threshold))


def exceeds_at(
    flags: list[float], stamp: np.ndarray, residual: np.ndarray, threshold: np.ndarray
) -> float | None:
    """
    Find the first of the samples over the threshold that raised the flag for the fault.

    :param flags: instants at which the flag rose [s].
    :param stamp: of each sample [ns], shape (n,).
    :param residual: |xi2| of equation (16), shape (n,).
    :param threshold: rho of equation (16), shape (n,).
    :return: the instant [s]; None where the fault is not decided.
    """
    flag = next((t for t in flags if t >= ONSET), None)
    if flag is None:
        return None
    row = int(np.searchsorted(stamp, round(flag * 1e9)))
    over = np.abs(residual) >= threshold
    while row > 0 and over[row - 1]:
        row -= 1
    return int(stamp[row]) * 1e-9


def raised(events: Mapping[str, np.ndarray]) -> list[float]:
    """
    Find when a fault was flagged.

    The events, not the flag: of two changes within a millisecond, as in a run faster than the
    real valve, `fault_flag` may bring the last one only.

    :param events: columns of `fault_event`; none where nothing happened.
    :return: stamps of the transitions to a fault [s].
    """
    if not len(events.get('stamp', ())):
        return []
    return [int(stamp) * 1e-9 for stamp in events['stamp'][events['transition'] == RAISED]]


def lost_samples(topics: Mapping[str, Mapping[str, np.ndarray]]) -> int:
    """
    Count what is missing: samples between the first and the last, on every fast topic.

    :param topics: columns by topic.
    :return: number of lost messages over all topics.
    """
    stamps = [rows['stamp'] for rows in topics.values()]
    first, last = min(s[0] for s in stamps), max(s[-1] for s in stamps)
    period = min(int(np.diff(s).min()) for s in stamps)
    expected = round((last - first) / period) + 1
    return sum(max(0, expected - len(s)) for s in stamps)


def same_as_recorded(result: Result, topics: Mapping[str, Mapping[str, np.ndarray]]) -> bool:
    """
    Tell whether the off-line core gives what the nodes have published, bit for bit.

    :param result: of the off-line core on the recorded measurement.
    :param topics: columns by topic.
    :return: whether every field of every sample is equal.
    """
    rows = result.accepted
    pairs = [
        (topics['/residual']['data'], result.decisions['residual'][rows]),
        (topics['/threshold']['data'], result.decisions['threshold'][rows]),
    ]
    estimate = topics['/estimate']
    for n, name in enumerate(('alpha1', 'alpha4', 'alpha5')):
        pairs.append((estimate['alpha_hat'][:, n], result.estimates[name][rows]))
    for name in result.estimates.dtype.names or ():
        if name in estimate:
            pairs.append((estimate[name], result.estimates[name][rows]))
    return all(
        a.shape == b.shape and a.astype(b.dtype).tobytes() == np.ascontiguousarray(b).tobytes()
        for a, b in pairs
    )
