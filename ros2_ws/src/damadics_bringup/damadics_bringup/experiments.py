# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The paper's two experiments, and the comparison of a recorded run with the paper."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from damadics_fd.bag.columns import read_columns
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.monitor import run
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings

FAST = ('/measurement', '/fault_state', '/estimate', '/residual', '/threshold')
ONSET = 70.0  # s, of both faults


@dataclass(frozen=True)
class Experiment:
    """One experiment of the paper (section 5)."""

    name: str
    scenario: str
    title: str
    paper: float  # detection instant [s]


EXPERIMENTS = (
    Experiment('friction', 'paper_friction', 'Incipient friction fault (Fig. 5)', 81.12),
    Experiment('spring', 'paper_spring', 'Abrupt spring fault (Fig. 6)', 70.005),
)


@dataclass(frozen=True)
class Outcome:
    """What one experiment gave."""

    experiment: Experiment
    detected_at: float | None  # s, live
    offline_detected_at: float | None  # s
    before: list[float]  # decisions before the fault [s], live
    samples: int
    counts: dict[str, int]
    lost: int
    identical: bool
    bag: Path
    bag_bytes: int
    figure: Path

    @property
    def agrees(self) -> bool:
        """Whether the run is whole, repeatable and detects when the paper does."""
        return (
            self.detected_at is not None
            and abs(self.detected_at - self.experiment.paper) < 1e-6
            and self.offline_detected_at == self.detected_at
            and self.identical
            and self.lost == 0
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the outcome for `results.json`."""
        values = asdict(self)
        values['experiment'] = self.experiment.title
        values['paper_detected_at'] = self.experiment.paper
        values['bag'], values['figure'] = str(self.bag), str(self.figure)
        values['agrees_with_paper'] = self.agrees
        return values


def judge(experiment: Experiment, bag: Path) -> tuple[Outcome, dict[str, Any], Result]:
    """
    Compare a recorded live run with the paper and with the off-line core.

    :param experiment: what was run.
    :param bag: its recording.
    :return: the outcome, the recorded columns (with `fault` and `strength`), the off-line result.
    """
    topics = {topic: read_columns(bag, topic) for topic in FAST}
    columns = dict(topics['/measurement'])
    result = run(columns, Settings.for_mode('paper'))
    counts = {topic: len(rows['stamp']) for topic, rows in topics.items()}
    edges = raised(read_columns(bag, '/fault_event'))
    offline = [event.stamp * 1e-9 for event in result.detections]
    truth = topics['/fault_state']
    if np.array_equal(truth['stamp'], columns['stamp']):
        columns.update(fault=truth['fault'], strength=truth['strength'])
    folder = bag.parent
    outcome = Outcome(
        experiment=experiment,
        detected_at=first_from(ONSET, edges),
        offline_detected_at=first_from(ONSET, offline),
        before=[t for t in edges if t < ONSET],
        samples=counts['/measurement'],
        counts=counts,
        lost=lost_samples(topics),
        identical=edges == offline and same_as_recorded(result, topics),
        bag=bag,
        bag_bytes=sum(path.stat().st_size for path in bag.rglob('*.mcap')),
        figure=folder / f'{experiment.name}.png',
    )
    return outcome, columns, result


def raised(events: dict[str, Any]) -> list[float]:
    """
    Find when a fault was flagged.

    The events, not the flag: of two changes within a millisecond, as in a run faster than the
    real valve, `fault_flag` may bring the last one only.

    :param events: columns of `fault_event`.
    :return: stamps of the transitions to a fault [s].
    """
    return [int(stamp) * 1e-9 for stamp in events['stamp'][events['transition'] == RAISED]]


def first_from(onset: float, instants: list[float]) -> float | None:
    """
    Return the first instant at or after the onset.

    :param onset: of the fault [s].
    :param instants: of decisions [s].
    :return: the instant [s], or None.
    """
    return next((t for t in instants if t >= onset), None)


def lost_samples(topics: dict[str, dict[str, Any]]) -> int:
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


def same_as_recorded(result: Result, topics: dict[str, dict[str, Any]]) -> bool:
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
    for name in result.estimates.dtype.names:
        if name in estimate:
            pairs.append((estimate[name], result.estimates[name][rows]))
    return all(
        a.shape == b.shape and a.astype(b.dtype).tobytes() == np.ascontiguousarray(b).tobytes()
        for a, b in pairs
    )
