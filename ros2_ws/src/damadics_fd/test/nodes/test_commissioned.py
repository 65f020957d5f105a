# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The verdict of commission, from the file of a valve to the diagnostics of its nodes."""

import pytest
from damadics_fd.commands.commission.valve_file import parameter_file
from damadics_fd.core.settings.identified import Identified
from damadics_fd.ros.commissioned import commissioned

NUMBERS = {'friction_in_an_hour': 0.185, 'spring_in_an_hour': 0.02, 'misfit': 0.1}


def test_the_nodes_tell_what_commission_wrote_into_the_file_of_the_valve(tmp_path):
    file, other = tmp_path / 'lv101.param.yaml', tmp_path / 'more.yaml'
    reasons = ("P1 is a constant: 'typed in'", 'too short')
    file.write_text(
        parameter_file(Identified('limited', {}, ('K = 1',), reasons, {}, NUMBERS), 'monitor', 'a')
    )
    other.write_text('/**:\n  ros__parameters: {mode: monitor}\n')
    assert commissioned([file, other]) == {
        'Commissioned': 'limited',
        'Friction change found within an hour (%)': '18',
        'Stiffness change found within an hour (%)': '2',
        'Commissioned because': "P1 is a constant: 'typed in'; too short",
    }


@pytest.mark.parametrize(
    'text',
    [
        '',
        '[1, 2',
        '/**/commission: {ros__parameters: {verdict: [ok]}}',
        '/**/commission: {ros__parameters: {verdict: splendid, friction_in_an_hour: .nan}}',
        '/**/commission: {ros__parameters: {friction_in_an_hour: true, reasons: {a: b}}}',
    ],
)
def test_without_a_verdict_a_valve_is_not_commissioned(tmp_path, text):
    file = tmp_path / 'lv101.param.yaml'
    file.write_text(text)
    assert commissioned([file, tmp_path / 'none.yaml'])['Commissioned'] == 'no'
