# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Several valves in two processes, on the page that people look at: each has its own state."""

import os
import signal
from types import SimpleNamespace

import pytest
import website
import yaml
from conftest import Peer, alone, children, free_port
from damadics_bringup.processes import Processes, surroundings
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultFlag
from damadics_msgs.srv import InjectFault, Shelve

pytestmark = pytest.mark.ros
FAULTY, SHELVED = 'lv101', 'lv102'
SPRING = 11  # f11
# six for the pictures: one of them learns long enough to be seen learning
VALVES = [FAULTY, SHELVED, 'fv203', *(['lv104', 'pv105', 'tv301'] if website.PICTURES else [])]
SLOW = 'tv301'
RATE = 50.0  # Hz


def entry(number: int, name: str) -> dict:
    learning = {
        't_on': 1.0,
        't_w': 5.0,
        't_learn': 600.0 if name == SLOW else 25.0,
        'travel_min': 0.5,
    }
    return {
        'settings': {
            'actuator': f'{name[:2].upper()}-{name[2:]}',
            'sample_rate': RATE,
            **learning,
        },
        'simulate': {**website.PLANT, 'rate': RATE, 'seed': number},
    }


@pytest.fixture(scope='module')
def fleet(tmp_path_factory):
    """All valves by one command, a browser where there is one, a node that listens."""
    folder = tmp_path_factory.mktemp('fleet')
    path = folder / 'fleet.yaml'
    path.write_text(yaml.safe_dump({'valves': {v: entry(n, v) for n, v in enumerate(VALVES, 1)}}))
    port = free_port()
    with pytest.MonkeyPatch.context() as patch:
        domain = alone(patch, folder)
        peer = Peer(domain, publishes=False)
        flags = {v: peer.listen(FaultFlag, f'/{v}/fault_flag', qos.FLAG) for v in VALVES}
        with (
            Processes(folder / 'logs', surroundings(domain)) as processes,
            website.browser() as chromium,
        ):
            processes.forget('PYTEST_CURRENT_TEST')  # the page is to run as it does elsewhere
            processes.start(
                'damadics_bringup',
                'run',
                [
                    str(path),
                    '--simulate',
                    '--dashboard',
                    '--port',
                    str(port),
                    '--processes',
                    '2',
                    '--logs',
                    str(folder / 'logs'),
                ],
            )
            address = f'http://127.0.0.1:{port}'
            website.wait_until_served(address)
            page = (
                website.new_page(chromium, viewport={'width': 1280, 'height': 800})
                if chromium
                else None
            )
            tiles = {v: website.Tile(address, v, page) for v in VALVES}
            yield SimpleNamespace(
                peer=peer, flags=flags, tiles=tiles, page=page, run=processes.pid('run')
            )
            processes.end('run', 60.0)
        peer.close()


def monitored(fleet) -> None:
    """Wait until all valves but the slow one have been learned."""
    learned = [valve for valve in VALVES if valve != SLOW]
    waiting = (FaultFlag.STATE_LEARNING, FaultFlag.STATE_NOT_MONITORING)
    assert fleet.peer.wait(
        lambda: all(fleet.flags[v] and fleet.flags[v][-1].state not in waiting for v in learned),
        180.0,
    ), 'not all valves have been learned'
    assert fleet.peer.wait(lambda: all(fleet.flags.values()))


def call(fleet, kind, name: str, **request) -> None:
    assert fleet.peer.call(kind, name, **request).success


def test_every_valve_has_its_own_state(fleet):
    monitored(fleet)
    call(fleet, InjectFault, f'/{FAULTY}/inject_fault', fault=SPRING, strength=1.0)
    call(fleet, Shelve, f'/{SHELVED}/shelve', duration=600.0, user='Anna')
    assert fleet.peer.wait(lambda: fleet.flags[FAULTY][-1].fault)
    fleet.tiles[FAULTY].wait(website.ALARM)
    fleet.tiles[SHELVED].wait(('C',))
    fleet.peer.wait(lambda: False, 15.0 if website.PICTURES else 3.0)
    if fleet.page:
        website.picture(fleet.page, 'fleet.png')
    for valve in set(VALVES) - {FAULTY, SHELVED, SLOW}:
        fleet.tiles[valve].wait(('ok',))
    assert not any(flag.fault for v in VALVES if v != FAULTY for flag in fleet.flags[v])


def test_two_processes_monitor_all_valves(fleet):
    ran = sorted(child.name for child in children(fleet.run) if child.name != 'plant')
    assert ran == ['dashboard', 'monitors', 'monitors']


def test_silence_greys_every_tile_and_ends_without_an_alarm(fleet):
    monitored(fleet)
    shown = website.ALARM if fleet.flags[FAULTY][-1].fault else ('ok',)
    plants = [child.pid for child in children(fleet.run) if child.name == 'plant']
    assert len(plants) == len(VALVES)
    before = {valve: fleet.flags[valve][-1].occurrence for valve in VALVES}
    for pid in plants:
        os.kill(pid, signal.SIGSTOP)
    try:
        for tile in fleet.tiles.values():
            tile.wait(('off',))
        if fleet.page:
            website.picture(fleet.page, 'silent.png')
        assert fleet.peer.wait(
            lambda: all(
                flags[-1].state == FaultFlag.STATE_NOT_MONITORING for flags in fleet.flags.values()
            )
        )
    finally:
        for pid in plants:
            os.kill(pid, signal.SIGCONT)
    fleet.tiles['fv203'].wait(('ok',))
    fleet.tiles[FAULTY].wait(shown)
    fleet.peer.wait(lambda: False, 2.0)
    assert {v: fleet.flags[v][-1].occurrence for v in VALVES} == before
