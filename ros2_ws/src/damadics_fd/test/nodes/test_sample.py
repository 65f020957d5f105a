# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The seven signals: the core's names, the message and the simulator's spans agree."""

import pytest
from damadics_fd.core.sample import COLUMNS, TABLE, Sample
from damadics_msgs.msg import Measurement
from damadics_plant.actuator.parameters import RANGES

pytestmark = pytest.mark.plain


def test_the_names_are_those_of_the_message():
    assert Sample._fields == COLUMNS
    assert tuple(Measurement.get_fields_and_field_types()) == ('header', *COLUMNS[1:])


def test_the_spans_are_those_of_the_benchmark():
    assert {s.name: s.span for s in TABLE if s.name in RANGES} == RANGES
