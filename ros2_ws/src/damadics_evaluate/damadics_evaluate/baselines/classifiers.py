# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Classifiers on windows that name faults: a random forest and a small neural network."""

import hashlib
import os
import pickle
import time
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
from damadics_fd.core.scada.naming.isolation import group_of

from damadics_evaluate.baselines import windows
from damadics_evaluate.baselines.windows import STEP, WINDOW, Features
from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import Detector, Diagnosis, require
from damadics_evaluate.scenarios.cases import STANDARD
from damadics_evaluate.scenarios.trajectories import (
    cache_directory,
    learning_hour,
    plant_hash,
    scenario_run,
)

UNSEEN = (8, 14)  # leave no trace in the six signals
NEGATIVE = (12, 14, 19)  # as the standard scenarios have them
STRENGTHS = (0.08, 0.2, 0.4, 0.65, 0.9)  # none of the standard ones
SEED = 700_000  # of the runs to learn from; no campaign uses it
FREE_RUNS = 6
MARGIN_S = 60.0  # of a run with a fault, after its start, that is not learned
SMALLEST = 1e-6
AS_LIKELY = 0.5  # of the most probable fault, for a candidate
FAULT_FREE = 0


class Classifier(Protocol):
    """What scikit-learn's classifiers have."""

    classes_: np.ndarray

    def fit(self, rows: Floats, labels: np.ndarray) -> 'Classifier':
        """Learn."""
        ...

    def predict_proba(self, rows: Floats) -> Floats:
        """Return the probability of every class."""
        ...


class WindowClassifier(Detector):
    """
    Probability of the classes "fault-free" and f1 .. f19 (without f8, f14) per window.

    The classifier learns once from simulated faults of strengths and seeds that no campaign has;
    it is kept in the cache under a hash of plant, features and settings. Per run, only the
    regressions of `Features` are learned. The statistic is -log P(fault-free), the mean of three
    windows.
    """

    def fit(self, hour: Floats) -> None:
        """Learn the regressions of the features."""
        self._features = Features(self.learning_rows(hour))

    def statistic(self, samples: Floats) -> Floats:
        """Return -log of the probability of "fault-free", 0 before the tests are on."""
        probability = self._probability(samples)
        out = np.zeros(len(samples))
        if len(probability):
            free = np.log(np.maximum(probability[:, FAULT_FREE], SMALLEST))
            smooth = np.convolve(-free, np.ones(3) / 3.0)[: len(free)]
            held = np.repeat(smooth, STEP)[: len(samples) - WINDOW + 1]
            out[WINDOW - 1 : WINDOW - 1 + len(held)] = held
        return np.where(self.active(samples), out, 0.0)

    def isolate_at(self, samples: Floats, alarm: float, times: Sequence[float]) -> list[Diagnosis]:
        """Rank the faults by their mean log probability since the alarm; see `Detector`."""
        model = self.model()
        probability = self._probability(samples)
        ends = samples[WINDOW - 1 :: STEP, 0][: len(probability)]
        found = []
        for until in times:
            since = (ends >= alarm) & (ends <= until)
            if not since.any():
                continue
            score = np.log(np.maximum(probability[since], SMALLEST)).mean(axis=0)
            order = [int(i) for i in np.argsort(-score) if int(model.classes_[i]) != FAULT_FREE]
            best = float(score[order[0]])
            ranking = tuple(
                (int(model.classes_[i]), float('nan'), best - float(score[i])) for i in order
            )
            tied = tuple(f for f, _, cost in ranking if np.exp(-cost) >= AS_LIKELY)
            found.append(Diagnosis(until, ranking, tied, group_of(ranking[0][0])))
        return found

    def cause(self, samples: Floats, alarm: float) -> str:
        """Return the faults that are about as likely, the likeliest first."""
        found = self.isolate_at(samples, alarm, [float(samples[-1, 0])])
        return ' or '.join(f'f{fault}' for fault in found[-1].candidates) if found else ''

    def _probability(self, samples: Floats) -> Floats:
        rows = self._features.of(samples)
        if not len(rows):
            return np.empty((0, 1))
        return np.asarray(self.model().predict_proba(rows))

    def model(self) -> Classifier:
        """Return the classifier, learned or from the cache."""
        return _model(type(self))

    @abstractmethod
    def untrained(self) -> Classifier:
        """Return the classifier before it has learned."""


class Forest(WindowClassifier):
    """A random forest."""

    name, title = 'forest', 'random forest on windows (scikit-learn)'

    def __init__(self, trees: int = 60, leaf: int = 3, seed: int = 0) -> None:
        self.trees, self.leaf, self.seed = trees, leaf, seed

    def untrained(self) -> Classifier:
        """Return the forest before it has learned."""
        ensemble = require('sklearn.ensemble', self.name)
        forest: Classifier = ensemble.RandomForestClassifier(
            self.trees, min_samples_leaf=self.leaf, random_state=self.seed, n_jobs=1
        )
        return forest


class Network(WindowClassifier):
    """A neural network of one hidden layer."""

    name, title = 'mlp', 'neural network on windows (scikit-learn)'

    def __init__(self, hidden: int = 32, seed: int = 0) -> None:
        self.hidden, self.seed = hidden, seed

    def untrained(self) -> Classifier:
        """Return the network, behind a scaler, before it has learned."""
        network = require('sklearn.neural_network', self.name)
        pipeline = require('sklearn.pipeline', self.name)
        scaling = require('sklearn.preprocessing', self.name)
        made: Classifier = pipeline.make_pipeline(
            scaling.StandardScaler(),
            network.MLPClassifier(
                (self.hidden,), max_iter=400, early_stopping=True, random_state=self.seed
            ),
        )
        return made


def train(tell: Callable[[str], None], names: Sequence[str]) -> None:
    """
    Learn what is not in the cache yet, before a campaign and apart from its time.

    :param tell: told what was learned and how long it took.
    :param names: of the detectors of the campaign.
    """
    for kind in (Forest, Network):
        if kind.name in names and not _file(kind).exists():
            started = time.perf_counter()
            _model(kind)
            tell(
                f'{kind.name} learned in {time.perf_counter() - started:.0f} s, kept in the cache'
            )


def _file(kind: type[WindowClassifier]) -> Path:
    sklearn = require('sklearn', kind.name)
    shape = (kind.name, kind().settings(), STRENGTHS, SEED, FREE_RUNS, sklearn.__version__)
    digest = hashlib.sha256(repr(shape).encode())
    for source in (windows.__file__, __file__):
        digest.update(Path(source).read_bytes())
    return (
        cache_directory() / 'classifiers' / f'{kind.name}_{plant_hash()}_{digest.hexdigest()[:12]}'
    )


@cache
def _model(kind: type[WindowClassifier]) -> Classifier:
    file = _file(kind)
    if file.exists():
        stored: Classifier = pickle.loads(file.read_bytes())  # our own cache
        return stored
    rows, labels = _lessons()
    model = kind().untrained().fit(rows, labels)
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(f'.{os.getpid()}.tmp')
    partial.write_bytes(pickle.dumps(model))
    partial.replace(file)
    return model


@cache
def _lessons() -> tuple[Floats, np.ndarray]:
    """Return windows of simulated faults and their classes."""
    parts, labels = [], []
    faults = [fault for fault in STANDARD if fault not in UNSEEN]
    for number, fault in enumerate(faults):
        for strength in STRENGTHS:
            name = f'f{fault}@{-strength if fault in NEGATIVE else strength:g}'
            rows, late = _windows_of(name, SEED + number)
            parts.append(rows[late])
            labels.append(np.full(int(late.sum()), fault))
            if strength == STRENGTHS[-1]:
                early = ~late & (np.arange(len(rows)) * STEP + WINDOW - 1 < 900)
                early[: 300 // STEP] = False  # the start of the plant
                parts.append(rows[early])
                labels.append(np.full(int(early.sum()), FAULT_FREE))
    for run in range(FREE_RUNS):
        hour = learning_hour(SEED + 100 + run)
        rows = Features(learning_hour(SEED + 200 + run)[60:]).of(hour[300:])
        parts.append(rows)
        labels.append(np.full(len(rows), FAULT_FREE))
    return np.concatenate(parts), np.concatenate(labels)


def _windows_of(name: str, seed: int) -> tuple[Floats, np.ndarray]:
    samples, strength = scenario_run(name, seed)
    rows = Features(learning_hour(seed)[60:]).of(samples)
    ends = np.arange(len(rows)) * STEP + WINDOW - 1
    start = int(np.flatnonzero(strength != 0.0)[0])
    return rows, ends >= start + MARGIN_S
