# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is to be run: scenarios x detectors x seeds, and the settings that shape the results."""

import hashlib
import json
import platform
from dataclasses import dataclass, fields
from importlib.metadata import PackageNotFoundError, version

from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.benchmark.results import Result
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.scenarios.cases import SCENARIOS, case
from damadics_evaluate.scenarios.trajectories import NOISE

MARGIN = 1.1  # limit of a calibrated detector over its largest value on nominal days
CALIBRATION_SEED = 1_000_100
NOMINAL_SEED = 2_000_048  # the days before it set the margins of the tests
OWN_PACKAGES = ('damadics_fd', 'damadics_plant', 'damadics_evaluate')
LIBRARIES = ('numpy', 'numba', 'scipy', 'river', 'filterpy', 'scikit-learn')


@dataclass(frozen=True)
class Campaign:
    """
    What is to be run.

    :param scenarios: names of standard scenarios.
    :param detectors: names of detectors.
    :param seeds: seeds of the runs.
    :param calibration_days: fault-free days that set the limits of the baselines.
    :param nominal_days: further fault-free days on which false alarms are counted.
    :param debounce: consecutive samples at or above the limit that make a decision.
    :param isolated_seeds: isolation, the dearest part, runs for that many of the seeds.
    """

    scenarios: tuple[str, ...] = SCENARIOS
    detectors: tuple[str, ...] = tuple(DETECTORS)
    seeds: tuple[int, ...] = (0,)
    calibration_days: int = 3
    nominal_days: int = 0
    debounce: int = 1
    isolated_seeds: int = 5

    def __post_init__(self) -> None:
        """Refuse unknown names, all in one message."""
        wrong = []
        for name in self.detectors:
            try:
                find_detector(name)
            except ValueError as error:
                wrong.append(str(error))
        for name in self.scenarios:
            try:
                case(name)
            except ValueError as error:
                wrong.append(str(error))
        if wrong:
            raise ValueError('; '.join(wrong))
        for name in ('calibration_days', 'debounce'):
            if getattr(self, name) < 1:
                raise ValueError(f'{name} is {getattr(self, name)}: give 1 or more')

    @classmethod
    def of_manifest(cls, stated: Result) -> 'Campaign':
        """Return the campaign that a manifest states; settings of other versions are left out."""
        names = {item.name for item in fields(cls)}
        known: Result = {
            name: tuple(value) if isinstance(value, list) else value
            for name, value in stated.items()
            if name in names
        }
        return cls(**known)

    def settings_hash(self, detector: str) -> str:
        """Return a hash of everything but scenario and seed that shapes a detector's results."""
        shape = {
            'detector': detector,
            'settings': find_detector(detector)().settings(),
            'calibration_days': self.calibration_days,
            'debounce': self.debounce,
            'margin': MARGIN,
            'noise': NOISE,
        }
        text = json.dumps(shape, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def versions() -> dict[str, str]:
    """Return the versions of this package and of the libraries that took part."""
    found = {'python': platform.python_version()}
    for package in (*OWN_PACKAGES, *LIBRARIES):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = 'source' if package in OWN_PACKAGES else 'absent'
    return found
