# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tokens by role: who may see, who may act, which tokens are refused."""

import pytest
from damadics_fd.store.access import Access, AccessError, Role, parse_access, read_access

VIEW, ACT = 'v' * 16, 'a' * 32


def test_roles_come_from_the_file(tmp_path):
    path = tmp_path / 'tokens'
    path.write_text(f'# of the control room\n\nviewer {VIEW} wall\noperator {ACT} Anna B.\n')
    access = read_access(path)
    assert not access.open
    assert access.of(VIEW).role is Role.VIEWER
    assert (access.of(ACT).role, access.of(ACT).name) == (Role.OPERATOR, 'Anna B.')
    assert access.may_operate(ACT)
    assert not access.may_operate(VIEW)
    assert ACT not in repr(access.of(ACT))


def test_a_token_alone_is_the_operators_as_in_0_1():
    assert parse_access([ACT], 'x').of(ACT).role is Role.OPERATOR


@pytest.mark.parametrize('wrong', ['', 'x', ACT[:-1], ACT + 'a', 'ä' * 32, '\ud800', '\0'])
def test_a_wrong_token_is_nobody(wrong):
    access = parse_access([f'operator {ACT}'], 'x')
    assert access.of(wrong) is None
    assert not access.may_operate(wrong)


def test_without_tokens_everybody_of_this_machine_operates():
    assert Access().open
    assert Access().may_operate('')


@pytest.mark.parametrize(
    ('line', 'says'),
    [
        ('operator ab+c/d==efghijklmnopqrst', 'letters, digits'),
        ('operator ' + 'ä' * 20, 'letters, digits'),
        ('operator "' + 'a' * 20 + '";', 'letters, digits'),
        ('operator 1234567', 'too short'),
        ('admin ' + ACT, 'operator or viewer'),
    ],
)
def test_a_token_that_would_lock_its_user_out_is_refused_at_the_start(line, says):
    with pytest.raises(AccessError, match=says) as caught:
        parse_access(['# tokens', line], 'tokens')
    assert 'line 2' in str(caught.value)
    assert line.split()[1] not in str(caught.value)


def test_every_mistake_is_told_at_once():
    with pytest.raises(AccessError) as caught:
        parse_access(['operator x', f'viewer {VIEW}', f'viewer {VIEW}'], 'tokens')
    assert 'line 1' in str(caught.value)
    assert 'line 3: the token is there twice' in str(caught.value)


@pytest.mark.parametrize('content', [b'', b'# nothing\n', b'\xff\xfe\0', b'a' * 200_000])
def test_a_file_without_tokens_is_refused(tmp_path, content):
    path = tmp_path / 'tokens'
    path.write_bytes(content)
    with pytest.raises(AccessError, match='tokens'):
        read_access(path)
    with pytest.raises(AccessError, match='No such file'):
        read_access(tmp_path / 'none')
