# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detectors by name: built in, installed, or in a file."""

from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.detectors.base import Detector
from damadics_evaluate.detectors.own import adapted, names_of_installed


def find_detector(name: str) -> type[Detector]:
    """
    Return a detector.

    :param name: of a built-in one, of an entry point, FILE.py:CLASS or MODULE:CLASS.
    :return: class, made without arguments.
    :raises ValueError: where there is none; says which there are.
    """
    if name in DETECTORS:
        return DETECTORS[name]
    if ':' in name or name in names_of_installed():
        return adapted(name)
    known = [*DETECTORS, *names_of_installed()]
    raise ValueError(f'no detector {name}: there are {", ".join(known)}, and my.py:Class')


def title_of(name: str) -> str:
    """Return the title of a detector; its name where its file is gone."""
    try:
        return find_detector(name).title
    except ValueError:
        return name.rpartition(':')[2]
