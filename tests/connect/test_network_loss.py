# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The network itself goes and comes back, in a namespace of the test's own."""

import re
import sys
from pathlib import Path

import pytest
import yaml
from connect.servers import in_namespace, needs_namespace
from damadics_bringup.processes import executable

pytestmark = pytest.mark.ros
HERE = Path(__file__).parent
SERVER = HERE / 'opcua_server.py'
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


BROKER = """
ip link set lo up
{python} {here}/mqtt_broker.py 1883 > broker.log 2>&1 &
broker=$!
until (echo > /dev/tcp/127.0.0.1/1883) 2> /dev/null; do sleep 0.2; done
{python} {here}/sparkplug_device.py 1883 > device.log 2>&1 &
device=$!
{python} {here}/sparkplug_device.py 1883 listen > listener.log 2>&1 &
listener=$!
until [ "$(grep -c sample listener.log)" -ge 6 ]; do sleep 0.2; done
date +%s.%N > down; ip link set lo down
sleep 7
date +%s.%N > up; ip link set lo up
n=$(grep -c sample listener.log)
until [ "$(grep -c sample listener.log)" -ge $((n + 6)) ]; do sleep 0.2; done
kill $listener $device $broker
"""


@needs_namespace
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
    in_namespace(script, tmp_path)
    log = (tmp_path / 'connector.log').read_text()
    down, up = (float((tmp_path / name).read_text()) for name in ('down', 'up'))
    told = [(float(t), text) for t, text in re.findall(r'\[([0-9.]+)\] \[opcua\]: (.*)', log)]
    lost = [t for t, text in told if 'server or network is gone' in text]
    assert lost and 0.0 < lost[0] - down < 3.0, log  # 2 s, and a busy machine
    again = [t for t, text in told if text.startswith('connected to')][1]
    assert again > up
    assert (tmp_path / 'code').read_text().strip() == '0' and 'Traceback' not in log


@needs_namespace
def test_nothing_is_made_up_for_a_device_at_rest_while_the_broker_cannot_be_reached(tmp_path):
    in_namespace(BROKER.format(python=sys.executable, here=HERE), tmp_path)
    log = (tmp_path / 'listener.log').read_text()
    assert 'Traceback' not in log, log
    down, up = (float((tmp_path / name).read_text()) for name in ('down', 'up'))
    lines = [line.split(maxsplit=2) for line in log.splitlines()]
    samples = [(float(t), int(text.split()[0])) for t, what, text in lines if what == 'sample']
    told = [(float(t), text) for t, what, text in lines if what == 'told']
    during = [t - down for t, _ in samples if down < t < up]
    assert not during or max(during) < 2.0, log
    lost = [t for t, text in told if 'broker or network is gone' in text]
    assert lost and 0.0 < lost[0] - down < 3.0, log  # 2 s, and a busy machine
    stamps = [stamp for _, stamp in samples]
    assert stamps == sorted(set(stamps)), 'no sample is doubled'
    assert max(b - a for a, b in zip(stamps, stamps[1:], strict=False)) > 5e9, 'none made up'
