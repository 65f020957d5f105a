# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Metrics for Prometheus: one time series per valve and quantity."""

import time
from collections.abc import Callable, Iterable

from damadics_fd.core.stamps import is_date
from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest

from damadics_connect.judgement import CLASSES, STATES, Judgement
from damadics_connect.watch import Watch

LABELS = ('valve', 'actuator')


class Collector:
    """
    Makes the metrics when they are asked for.

    :param watch: what is known of the valves.
    """

    def __init__(self, watch: Watch) -> None:
        self._watch = watch

    def collect(self) -> Iterable[Metric]:
        """Return the metrics."""
        valves = list(self._watch.valves.values())
        yield _gauge('residual', 'Residual, in the unit of the mode', valves, _residual)
        yield _gauge('threshold', 'Limit of the residual', valves, _threshold)
        yield _gauge('ratio', 'Residual / limit', valves, lambda j: j.ratio)
        yield _gauge('fault', '1 while a fault is flagged', valves, lambda j: float(j.fault))
        yield _gauge(
            'monitored',
            '1 while the valve is judged; alert on 0',
            valves,
            lambda j: float(j.state not in ('not_monitored', 'unknown')),
        )
        yield _gauge('age_seconds', 'Age of the sample that the judgement rests on', valves, _age)
        yield _choice('state', 'State of the detector', valves, tuple(STATES.values()), _state)
        yield _choice('ne107', 'NAMUR NE 107 class', valves, CLASSES, lambda j: j.ne107)
        occurrences = CounterMetricFamily(
            'damadics_faults', 'Faults flagged since the start', labels=LABELS
        )
        for judgement in valves:
            occurrences.add_metric(_labels(judgement), judgement.occurrence)
        yield occurrences


def exposition(watch: Watch) -> tuple[bytes, str]:
    """
    Write all metrics.

    :param watch: what is known of the valves.
    :return: text and its media type.
    """
    registry = CollectorRegistry()
    registry.register(Collector(watch))
    return generate_latest(registry), CONTENT_TYPE_LATEST


def _labels(judgement: Judgement) -> list[str]:
    return [judgement.valve, judgement.actuator]


def _residual(judgement: Judgement) -> float:
    return judgement.residual


def _threshold(judgement: Judgement) -> float:
    return judgement.threshold


def _state(judgement: Judgement) -> str:
    return judgement.state


def _age(judgement: Judgement) -> float:
    if not is_date(judgement.stamp):
        return time.monotonic() - judgement.heard
    return (time.time_ns() - judgement.stamp) * 1e-9


def _gauge(
    name: str, text: str, valves: list[Judgement], value: Callable[[Judgement], float]
) -> GaugeMetricFamily:
    family = GaugeMetricFamily(f'damadics_{name}', text, labels=LABELS)
    for judgement in valves:
        family.add_metric(_labels(judgement), value(judgement))
    return family


def _choice(
    name: str,
    text: str,
    valves: list[Judgement],
    choices: tuple[str, ...],
    value: Callable[[Judgement], str],
) -> GaugeMetricFamily:
    family = GaugeMetricFamily(f'damadics_{name}', text, labels=(*LABELS, name))
    for judgement in valves:
        now = value(judgement)
        for choice in choices:
            family.add_metric([*_labels(judgement), choice], float(choice == now))
    return family
