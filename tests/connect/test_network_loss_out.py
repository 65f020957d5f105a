# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The network goes and comes back between whoever is told and us: events and notifications."""

import json
import sys
from pathlib import Path

import pytest
from connect.servers import in_namespace, needs_namespace
from damadics_bringup.processes import executable

pytestmark = [pytest.mark.ros, needs_namespace]
HERE = Path(__file__).parent
# ROS 2 is on a loopback of its own kind (shared memory) or on the one that goes: both may be
BEGIN = """
ip link set lo up
mkfifo told; {python} {here}/detectors.py lv1 < told > detectors.log 2>&1 & detectors=$!
exec 3> told
"""
EVENTS = """
{connector} http.yaml > http.log 2>&1 & http=$!
until (echo > /dev/tcp/127.0.0.1/8090) 2> /dev/null; do sleep 0.2; done
{python} {here}/event_listener.py 8090 > listener.log 2>&1 & listener=$!
until grep -q 'valve lv1 healthy' listener.log; do sleep 0.2; done
echo raised lv1 >&3
until grep -q 'event lv1 raised' listener.log; do sleep 0.2; done
date +%s.%N > down; ip link set lo down
sleep 1; echo acknowledged lv1 >&3; sleep 4
date +%s.%N > up; ip link set lo up
until grep -q 'event lv1 acknowledged' listener.log; do sleep 0.2; done
echo cleared lv1 >&3
until grep -q 'event lv1 cleared' listener.log; do sleep 0.2; done
until tail -n 3 listener.log | grep -q 'valve lv1 latched'; do sleep 0.2; done
kill $detectors $listener; date +%s.%N > gone
{python} {here}/event_listener.py 8090 > after.log 2>&1 & listener=$!
until grep -q 'valve lv1 not_monitored' after.log; do sleep 0.2; done
kill $listener; kill -INT $http; wait $http; echo $? > code
"""
MAILS = """
{python} {here}/mail_server.py 2525 mails > mail.log 2>&1 & mail=$!
until (echo > /dev/tcp/127.0.0.1/2525) 2> /dev/null; do sleep 0.2; done
{connector} notify.yaml > notify.log 2>&1 & notify=$!
echo raised lv1 >&3
until [ "$(cat mails | wc -l)" -ge 1 ]; do sleep 0.2; done
ip link set lo down; sleep 1
echo cleared lv1 >&3; sleep 0.5; echo raised lv1 >&3; sleep 3.5
ip link set lo up
until [ "$(cat mails | wc -l)" -ge 3 ]; do sleep 0.2; done
echo cleared lv1 >&3
until [ "$(cat mails | wc -l)" -ge 4 ]; do sleep 0.2; done
kill $detectors $mail; kill -INT $notify; wait $notify; echo $? > code
"""


def run(folder: Path, script: str, connector: str) -> None:
    text = (BEGIN + script).format(
        python=sys.executable, here=HERE, connector=executable('damadics_connect', connector)
    )
    in_namespace(text, folder)
    log = (folder / f'{connector}.log').read_text()
    assert (folder / 'code').read_text().strip() == '0' and 'Traceback' not in log, log


def test_who_listens_to_events_knows_of_the_loss_and_misses_none(domain, tmp_path):
    (tmp_path / 'http.yaml').write_text('port: 8090\n')
    run(tmp_path, EVENTS, 'http')
    down, up = (float((tmp_path / name).read_text()) for name in ('down', 'up'))
    lines = [line.split() for line in (tmp_path / 'listener.log').read_text().splitlines()]
    silent = [float(t) - down for t, what, *_ in lines if what == 'silence' and float(t) > down]
    assert silent and silent[0] < 3.0  # 2 s, and a busy machine
    words = [(float(t), rest) for t, *rest in lines if rest[0] != 'silence']
    assert not [rest for t, rest in words if down + 0.5 < t < up], 'nobody can have said it'
    transitions = [rest[2] for _, rest in words if rest[0] == 'event']
    assert transitions == ['raised', 'acknowledged', 'cleared'], 'none lost, none twice'
    numbers = [int(rest[3]) for _, rest in words]
    assert numbers == sorted(set(numbers))


def test_mails_of_a_time_without_network_arrive_once_and_in_order(domain, tmp_path):
    address = 'mailto://127.0.0.1:2525?from=fd@plant.example&to=shift@plant.example'
    (tmp_path / 'shift.url').write_text(f'{address}&mode=insecure\n')
    (tmp_path / 'notify.yaml').write_text(
        'targets:\n  shift: {url_file: shift.url}\nspool: spool.sqlite\n'
        'rules:\n  - {to: [shift], what: [raised, cleared]}\n'
    )
    (tmp_path / 'mails').touch()
    run(tmp_path, MAILS, 'notify')
    mails = [json.loads(line) for line in (tmp_path / 'mails').read_text().splitlines()]
    told = [mail['subject'].partition(': ')[2] for mail in mails]
    assert told == ['alarm', 'alarm over', 'alarm', 'alarm over']
