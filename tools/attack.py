#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Attack running nodes: damaged state files, odd requests, processes killed and stopped.

    make attack ARGS='--files 2000 --requests 1000 --signals 200 --pages 500'

Counts what must not happen: a lost alarm, "healthy" for longer than 2 s about old samples, the end
of a process. Shares no code with the tests. Exit code 1 where anything was found.
"""

import argparse
import math
import os
import random
import signal
import string
import sys
import tempfile
import time
from pathlib import Path

import rclpy
from attacks.connector import attack_connector
from attacks.page import attack_history, attack_page
from attacks.prey import HEALTHY, UNKNOWN, Prey
from damadics_msgs.srv import Acknowledge, Reference, Relearn, ResetAlarm, Shelve
from lifecycle_msgs.srv import ChangeState

CONFIGURE, CLEANUP, ACTIVATE, DEACTIVATE = 1, 2, 3, 4
START = 300.0  # s that a node may take to start on a busy machine
ODD_NUMBERS = (math.nan, math.inf, -math.inf, -1.0, 0.0, 5e-324, 1e-12, 1e308, 2.0**62)


def mutated(data: bytes, chance: random.Random) -> bytes | None:
    """Return damaged bytes; None to make a folder of it."""
    kind = chance.randrange(12)
    if kind == 0:
        return data[: chance.randrange(len(data) + 1)]
    if kind == 1:
        return b''
    if kind == 2:
        return bytes(len(data))
    if kind == 3:
        return None
    if kind == 4:
        return b'[' * 50_000
    if kind == 5:
        return data.replace(b'true', chance.choice([b'false', b'"yes"', b'1', b'null']))
    if kind == 6:
        digits = [n for n, byte in enumerate(data) if 48 <= byte < 58]
        place = chance.choice(digits)
        new = chance.choice([b'-1', b'9' * 5000, b'NaN', b'1e999', b'[]', b'4294967296'])
        return data[:place] + new + data[place + 1 :]
    if kind == 7:
        lines = data.splitlines(keepends=True)
        chance.shuffle(lines)
        return b''.join(lines)
    damaged = bytearray(data)
    for _ in range(chance.randint(1, 8)):
        place = chance.randrange(len(damaged))
        damaged[place] = chance.randrange(256)
    return bytes(damaged)


def put(file: Path, data: bytes | None) -> None:
    """Write a file, or make a folder of it."""
    if file.is_dir():
        file.rmdir()
    if data is None:
        file.unlink(missing_ok=True)
        file.mkdir()
    else:
        file.write_bytes(data)


def attack_files(prey: Prey, count: int) -> None:
    """Damage what is kept, configure the nodes anew, look at the first flag."""
    folders = folders_of(prey)
    alarms = prey.folder / 'kept'
    prey.start('estimator', **folders['estimator'])
    prey.start('detector', **folders['detector'])
    assert prey.spin(300.0, lambda: bool(prey.flags)), 'the detector does not start'
    assert prey.has_alarm(), 'there is no alarm to lose'
    wanted = prey.flags[-1].occurrence
    kept = {f: f.read_bytes() for f in alarms.rglob('*') if f.is_file()}
    print('kept:', *sorted(f.relative_to(alarms) for f in kept), flush=True)
    nodes = ('estimator', 'detector')
    for node in nodes:
        prey.transit(node, DEACTIVATE)
        prey.transit(node, CLEANUP)
    for n in range(count):
        for file in [f for f in alarms.rglob('*') if '.bad-' in f.name]:
            file.rmdir() if file.is_dir() else file.unlink()
        for file, data in kept.items():
            put(file, data)
        chosen = [f for f in kept if prey.random.random() < 0.9] or list(kept)
        for file in chosen:
            put(file, mutated(kept[file], prey.random))
        before = len(prey.flags)
        if not all([prey.transit(node, CONFIGURE) for node in nodes]):
            prey.found['not configured'] += 1
        elif not prey.spin(5.0, lambda b=before: len(prey.flags) > b):
            prey.found['no flag'] += 1
        else:
            flag = prey.flags[-1]
            safe = flag.state == UNKNOWN or (flag.fault and flag.occurrence == wanted)
            if not safe:
                prey.found['lost alarm'] += 1
                print('lost:', n, flag.state, flag.fault, flag.occurrence, flush=True)
            prey.found['shown as unknown' if flag.state == UNKNOWN else 'kept'] += 1
        for node in nodes:
            prey.transit(node, CLEANUP)
        if prey.ended():
            prey.found['process ended'] += 1
            print('ended:', n, prey.ended(), flush=True)
            return
    for node in nodes:
        prey.transit(node, CONFIGURE)
        prey.transit(node, ACTIVATE)


def folders_of(prey: Prey) -> dict[str, dict[str, str]]:
    """Return the parameters that say where the nodes keep what survives them."""
    kept = prey.folder / 'kept'
    return {
        'estimator': {'reference': str(kept / 'reference')},
        'detector': {'alarm_folder': str(kept), 'signature_folder': str(kept / 'signature')},
    }


def text(chance: random.Random) -> str:
    """Return a text that somebody might send."""
    return chance.choice(
        [
            '',
            '"><script>x</script>',
            '\x1b[31m\n\r\t',
            'x' * 100_000,
            '../../etc/passwd',
            '/proc/self/mem',
            '\u202e\u0000ä',
            ''.join(chance.choices(string.printable, k=50)),
        ]
    )


def attack_services(prey: Prey, count: int) -> None:
    """Send odd requests; each is answered, and no process ends."""
    chance = prey.random
    for n in range(count):
        signed = {'user': text(chance), 'comment': text(chance)}
        kind, name, request = chance.choice(
            [
                (Acknowledge, 'acknowledge', {'occurrence': chance.choice((0, 1, 7, 2**32 - 1))}),
                (ResetAlarm, 'reset', {}),
                (Shelve, 'shelve', {'duration': chance.choice(ODD_NUMBERS)}),
                (Relearn, 'relearn', {}),
                (Reference, 'save_reference', {'path': text(chance)}),
                (Reference, 'load_reference', {'path': text(chance)}),
                (ChangeState, 'detector/change_state', {}),
                (ChangeState, 'estimator/change_state', {}),
            ]
        )
        if kind is ChangeState:
            wanted = ChangeState.Request().transition
            wanted.id = chance.choice((3, 8, 50, 60, 200, 255))
            request = {'transition': wanted}
        elif kind is not Reference:
            request |= signed
        if prey.call(kind, name, 10.0, drive=True, **request) is None:
            prey.found[f'no answer from {name}'] += 1
        if prey.ended():
            prey.found['process ended'] += 1
            print('ended:', n, name, request, flush=True)
            return


def attack_signals(prey: Prey, count: int) -> None:
    """Stop and kill nodes at random times; look for an old judgement that is called healthy."""
    chance = prey.random
    old_since = 0.0
    worst = 0.0
    seen = len(prey.flags)

    def judge() -> None:
        nonlocal seen, old_since, worst
        for flag, age, came in zip(
            prey.flags[seen:], prey.ages[seen:], prey.came[seen:], strict=True
        ):
            if flag.state == HEALTHY and age > 2.5:
                old_since = old_since or came
                worst = max(worst, came - old_since)
            else:
                old_since = 0.0
        seen = len(prey.flags)

    prey.call(ResetAlarm, 'reset')
    prey.call(Shelve, 'shelve')
    prey.hurry(300.0, lambda: prey.flags[-1].state == HEALTHY)
    for n in range(count):
        prey.valve.faulty = n % 16 >= 12
        if n % 16 == 0:
            prey.call(ResetAlarm, 'reset', drive=True)
        prey.found['seen ' + ('with an alarm' if prey.flags[-1].fault else 'without one')] += 1
        name = chance.choice(('estimator', 'detector'))
        process = prey.processes[name]
        if chance.random() < 0.5:
            process.send_signal(signal.SIGSTOP)
            prey.drive(chance.uniform(0.1, 4.0))
            process.send_signal(signal.SIGCONT)
        else:
            fault = prey.flags[-1].fault
            process.kill()
            process.wait()
            prey.start(name, **folders_of(prey)[name])
            before = len(prey.flags)
            if name == 'detector':
                if not prey.drive(START, until=lambda b=before: len(prey.flags) > b):
                    prey.found['no flag'] += 1
                    print(f'signal {n}: no flag within {START:g} s of a start', flush=True)
                    continue
                first = prey.flags[before]
                if fault and not first.fault and first.state != UNKNOWN:
                    prey.found['lost alarm'] += 1
                    print(f'signal {n}: lost', prey.flags[before - 1], first, flush=True)
        end = time.monotonic() + chance.uniform(0.5, 3.0)
        while time.monotonic() < end:
            prey.drive(0.1)
            judge()
    prey.found['seconds of old health (worst, ms)'] = round(1e3 * worst)
    if worst > 2.0:
        prey.found['false healthy'] += 1


def tracebacks(folder: Path) -> int:
    """Print the tracebacks in the logs; return how many there are."""
    texts = [file.read_text(errors='replace') for file in folder.glob('*.log')]
    found = [part for text in texts for part in text.split('Traceback')[1:]]
    for part in found[:3]:
        print('Traceback' + part[-1500:], flush=True)
    return len(found)


def main() -> int:
    """
    Run the attack.

    :return: 0, or 1 where something was found.
    """
    p = argparse.ArgumentParser(prog='attack', description=__doc__.split('\n')[1])
    p.add_argument('--files', type=int, default=2000, help='sets of damaged files (2000)')
    p.add_argument('--requests', type=int, default=1000, help='odd requests (1000)')
    p.add_argument('--signals', type=int, default=200, help='SIGSTOP and SIGKILL (200)')
    p.add_argument(
        '--pages',
        type=int,
        default=500,
        help='malformed requests to the page, and to the HTTP connector (500)',
    )
    p.add_argument('--histories', type=int, default=500, help='damaged histories (500)')
    p.add_argument('--mode', choices=('paper', 'monitor'), default='monitor', help='of the nodes')
    p.add_argument('--seed', type=int, default=1)
    options = p.parse_args()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(random.SystemRandom().randint(1, 99)))
    with tempfile.TemporaryDirectory() as folder:
        rclpy.init()
        prey = Prey(Path(folder), options.seed, options.mode)
        try:
            attack_history(prey.folder, options.histories, prey.random, prey.found)
            attack_page(prey.folder, options.pages, prey.random, prey.found)
            attack_connector(prey.folder, options.pages, prey.random, prey.found)
            if options.files or options.requests or options.signals:
                attack_files(prey, options.files)
                attack_services(prey, options.requests)
                attack_signals(prey, options.signals)
        finally:
            for process in prey.processes.values():
                process.kill()
            traces = tracebacks(prey.folder)
            rclpy.try_shutdown()
    prey.found['tracebacks in the logs'] = traces
    for what, number in sorted(prey.found.items()):
        print(f'{number:7d}  {what}')
    bad = ('lost', 'ended', 'false', 'failed', 'not configured', 'no flag', 'no answer')
    return int(traces > 0 or any(n for what, n in prey.found.items() if what.startswith(bad)))


if __name__ == '__main__':
    sys.exit(main())
