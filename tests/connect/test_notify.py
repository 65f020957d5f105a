# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Notifications through a real mail server: nothing lost while it is away, no secret shown."""

import json
import subprocess
import time
from contextlib import closing

import pytest
from conftest import PATIENCE
from connect.detectors import Detectors
from connect.servers import Server, wait_for
from damadics_bringup.processes import executable
from damadics_connect.notify.spool import Spool
from damadics_msgs.msg import FaultEvent

pytestmark = pytest.mark.ros
PASSWORD = 'hunter2hunter2'


@pytest.fixture
def mail(tmp_path):
    server = Server(tmp_path, 'mail_server.py', tmp_path / 'mails')
    server.path = tmp_path / 'mails'
    yield server
    server.kill()


def mails(server) -> list[dict]:
    if not server.path.exists():
        return []
    return [json.loads(line) for line in server.path.read_text().splitlines()]


def waiting(folder) -> int:
    with closing(Spool(folder / 'spool.sqlite')) as spool:
        return spool.count()


def configure(folder, server) -> str:
    address = f'mailto://me:{PASSWORD}@127.0.0.1:{server.port}?from=fd@plant.example'
    (folder / 'shift.url').write_text(f'{address}&to=shift@plant.example&mode=insecure\n')
    (folder / 'notify.yaml').write_text(
        'targets:\n  shift: {url_file: shift.url}\nspool: spool.sqlite\n'
        'rules:\n  - {to: [shift], what: [raised, cleared, not_monitored]}\n'
    )
    return str(folder / 'notify.yaml')


def test_nothing_is_lost_while_the_network_is_away_and_nothing_is_told_twice(
    processes, domain, tmp_path, mail
):
    config = configure(tmp_path, mail)
    with Detectors(domain, 'lv1', 'lv2') as detectors:
        processes.start('damadics_connect', 'notify', [config])
        log = processes.log('notify')
        time.sleep(4.0)
        detectors.judge('lv1', FaultEvent.RAISED, 'friction up\r\nBcc: all@plant.example')
        assert wait_for(lambda: len(mails(mail)) == 1), log.read_text()
        assert mails(mail)[0]['subject'] == '[DAMADICS FD] LV1: alarm'
        assert 'friction up Bcc: all@plant.example' in mails(mail)[0]['body']
        assert mails(mail)[0]['to'] == ['shift@plant.example']
        # a server that dies before it has said that it took the message gets it once more
        assert wait_for(lambda: waiting(tmp_path) == 0), log.read_text()

        mail.kill()
        detectors.judge('lv1', FaultEvent.CLEARED)
        detectors.judge('lv2', FaultEvent.RAISED, 'spring softer')
        assert wait_for(lambda: 'takes no message: kept' in log.read_text()), log.read_text()
        processes.kill('notify')
        mail.start()
        processes.start('damadics_connect', 'notify', [config], 'again')
        assert wait_for(lambda: len(mails(mail)) >= 3), processes.log('again').read_text()
        detectors.silence()
        assert wait_for(lambda: len(mails(mail)) >= 5)
        subjects = [each['subject'].removeprefix('[DAMADICS FD] ') for each in mails(mail)]
        assert subjects[:3] == ['LV1: alarm', 'LV1: alarm over', 'LV2: alarm']
        assert sorted(subjects[3:]) == ['LV1: not monitored', 'LV2: not monitored']
        words = log.read_text() + processes.log('again').read_text()
        assert PASSWORD not in words and 'Traceback' not in words


def test_the_test_command_tells_what_arrives(domain, tmp_path, mail):
    config = configure(tmp_path, mail)
    command = [executable('damadics_connect', 'notify'), config, '--test']
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert (done.returncode, done.stdout) == (0, 'shift: delivered\n'), done.stderr
    mail.kill()
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 1 and done.stdout.startswith('shift: NOT delivered')
    assert PASSWORD not in done.stdout + done.stderr
