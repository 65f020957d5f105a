# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that people name to the nodes: references below their folder, parameter files."""

import pytest

pytestmark = pytest.mark.ros


@pytest.mark.parametrize(
    ('path', 'says'),
    [
        ('../../x', 'is not below'),
        ('/etc/x', 'is not below'),
        ('a\0b', 'no path'),
        ('x' * 5000, 'no path'),
        ('.', 'is not below'),
        ('sub/../../x', 'is not below'),
    ],
    ids=['up', 'absolute', 'nul', 'long', 'folder', 'detour'],
)
def test_a_reference_stays_below_its_folder(path, says, tmp_path):
    from damadics_fd.store.references import reference_path

    with pytest.raises(ValueError, match=says):
        reference_path(path, tmp_path / 'lv101')


def test_a_reference_is_asked_for_by_its_name(tmp_path, monkeypatch):
    from damadics_fd.store.references import reference_path

    assert reference_path('', tmp_path / 'lv101') == tmp_path / 'lv101'
    assert reference_path('other', tmp_path / 'lv101') == tmp_path / 'other'
    assert reference_path(str(tmp_path / 'b'), tmp_path / 'lv101') == tmp_path / 'b'
    (tmp_path / 'link').symlink_to('/etc')
    with pytest.raises(ValueError, match='is not below'):
        reference_path('link/x', tmp_path / 'lv101')
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    assert reference_path('a', None) == tmp_path / 'damadics_fd' / 'references' / 'a'
    with pytest.raises(ValueError, match='no file'):
        reference_path('', None)


@pytest.mark.parametrize(
    ('content', 'says'),
    [
        ('a sentence', 'no section'),
        ('', 'no section'),
        ('/lv999/estimator: {ros__parameters: {mode: paper}}', '/lv999/estimator'),
        ('[1, 2', 'no parameter file'),
    ],
    ids=['text', 'empty', 'other', 'broken'],
)
def test_a_parameter_file_that_sets_nothing_is_told(tmp_path, content, says):
    from damadics_fd.ros.parameter_files import says_nothing

    file = tmp_path / 'p.yaml'
    file.write_text(content)
    told = says_nothing(file, '/zz1/estimator')
    assert told.startswith(f'{file} sets nothing for /zz1/estimator')
    assert says in told


@pytest.mark.parametrize(
    'content',
    [
        '/**: {ros__parameters: {mode: paper}}',
        '/**/estimator: {ros__parameters: {mode: paper}}',
        '/zz1/estimator: {ros__parameters: {mode: paper}}',
        '/*/estimator: {ros__parameters: {mode: paper}}',
        'zz1: {estimator: {ros__parameters: {mode: paper}}}',
        '/zz1/**: {ros__parameters: {mode: paper}}',
    ],
)
def test_a_parameter_file_that_sets_something_is_not_told(tmp_path, content):
    from damadics_fd.ros.parameter_files import says_nothing

    file = tmp_path / 'p.yaml'
    file.write_text(content)
    assert says_nothing(file, '/zz1/estimator') == ''
