# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The network itself goes and comes back, in a namespace of the test's own."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from damadics_bringup.processes import executable

pytestmark = pytest.mark.ros
SERVER = Path(__file__).parent / 'opcua_server.py'
SCRIPT = """
ip link set lo up
{python} {server} 4840 1 --rate 5 > server.log 2>&1 &
server=$!
{connector} plant.yaml > connector.log 2>&1 &
connector=$!
until grep -q 'connected to' connector.log; do sleep 0.2; done
sleep 3
date +%s.%N > down; ip link set lo down
sleep 6
date +%s.%N > up; ip link set lo up
until [ "$(grep -c 'connected to' connector.log)" -ge 2 ]; do sleep 0.2; done
sleep 1
kill -INT $connector; wait $connector; echo $? > code
kill $server
"""


def allowed() -> bool:
    if not (shutil.which('unshare') and shutil.which('ip')):
        return False
    return subprocess.run(['unshare', '-rn', 'true'], capture_output=True).returncode == 0


@pytest.mark.skipif(not allowed(), reason='network namespaces are not allowed here')
def test_a_lost_network_is_told_within_two_seconds_and_resumed(domain, tmp_path):
    signals = {'cv': {'node': 'ns=2;s=LV0.CV'}, 'x1': {'node': 'ns=2;s=LV0.PV'}}
    config = {
        'server': 'opc.tcp://127.0.0.1:4840',
        'period': 0.2,
        'valves': {'lv0': {'signals': signals}},
    }
    (tmp_path / 'plant.yaml').write_text(yaml.safe_dump(config))
    script = SCRIPT.format(
        python=sys.executable, server=SERVER, connector=executable('damadics_connect', 'opcua')
    )
    subprocess.run(
        ['unshare', '-rn', 'bash', '-c', script],
        cwd=tmp_path,
        timeout=200,
        env={**os.environ, 'RCUTILS_LOGGING_BUFFERED_STREAM': '0'},
        check=True,
    )
    log = (tmp_path / 'connector.log').read_text()
    down, up = (float((tmp_path / name).read_text()) for name in ('down', 'up'))
    told = [(float(t), text) for t, text in re.findall(r'\[([0-9.]+)\] \[opcua\]: (.*)', log)]
    lost = [t for t, text in told if 'server or network is gone' in text]
    assert lost and 0.0 < lost[0] - down < 3.0, log  # 2 s, and a busy machine
    again = [t for t, text in told if text.startswith('connected to')][1]
    assert again > up
    assert (tmp_path / 'code').read_text().strip() == '0' and 'Traceback' not in log
