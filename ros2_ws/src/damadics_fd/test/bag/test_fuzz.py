# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Mutations of bags that know the structure of MCAP: no traceback, no hang, no silent loss.

`make fuzz` runs thousands with the seeds of today; the tests run some with a fixed seed. Every
third round over the bags goes through the commands, the others through what these are made of.
"""

import contextlib
import io
import json
import os
import random
import struct
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from damadics_fd.bag import BagError, BagWriter, iter_columns, write_columns
from damadics_fd.bag.checking.inspection import LOSSY, UNUSABLE, WHOLE, inspect
from damadics_fd.bag.mcap.records import HEAD, MAGIC
from damadics_fd.bag.salvage import salvage
from damadics_fd.commands import recover, verify
from damadics_fd.commands.replay import replay
from damadics_fd.commands.replay.bags import Plan, warm_up

from .bag_support import needs_messages, simulated
from .block_support import valves, write_blocks
from .test_conformance import Maker
from .test_damage import small_bag

pytestmark = needs_messages
FIXED, COUNT = 14, 300
EVERY = 3  # round over the bags goes through the commands
BLOCKS, OF_BLOCKS, ROWS = 'blocks', 3, 200  # name of the bag of many valves, they, of each
SECONDS = 10.0  # of the processor, for one mutation


def seeds(folder: Path) -> list[Path]:
    """Return six bags of different kinds."""
    names = ('small', 'columns', 'many', 'loose', 'extras', BLOCKS)
    paths = [folder / f'{name}.mcap' for name in names]
    small_bag(paths[0])
    write_columns(paths[1], simulated(300))
    with BagWriter(paths[2], chunk_size=300) as bag:
        topics = [bag.add_topic(f'/v{i}/measurement', 'std_msgs/msg/Float64') for i in range(5)]
        for i in range(60):
            bag.write(topics[i % 5], b'\0\1\0\0' + struct.pack('<d', i), i, i)
    paths[3].write_bytes(Maker({'statistics', 'crc', 'repeat'}, 'all').build())
    chunked = {'chunk', 'chunk_index', 'message_index', 'statistics', 'crc', 'repeat', 'pad'}
    paths[4].write_bytes(Maker(chunked, 'all').build())
    write_blocks(paths[5], valves(OF_BLOCKS, ROWS))
    return paths


def spans(data: bytes) -> list[tuple[int, int, int]]:
    """Return opcode, begin and end of each record that stands where it should."""
    at, found = len(MAGIC), []
    while at + HEAD.size <= len(data) - len(MAGIC):
        op, length = HEAD.unpack_from(data, at)
        end = at + HEAD.size + length
        if end > len(data):
            break
        found.append((op, at, end))
        at = end
    return found


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Change one thing: bits, bytes, a whole record, a length, an opcode, the end."""
    records = spans(data)
    if not records:
        return data[: rng.randrange(len(data) + 1)]
    op, begin, end = rng.choice(records)
    kind = rng.randrange(11)
    at = rng.randrange(len(data))
    if kind == 0:  # a bit
        return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
    if kind == 1:  # a record is missing
        return data[:begin] + data[end:]
    if kind == 2:  # a record is there twice
        return data[:end] + data[begin:end] + data[end:]
    if kind == 3:  # two records change places
        _, other, last = rng.choice(records)
        if end <= other:
            return (
                data[:begin] + data[other:last] + data[end:other] + data[begin:end] + data[last:]
            )
        return data
    if kind == 4:  # a length
        value = rng.choice((0, 1, 2**31, 2**63, 2**64 - 1, end - begin + rng.randrange(-9, 9)))
        return data[: begin + 1] + struct.pack('<Q', value % 2**64) + data[begin + 9 :]
    if kind == 5:  # an opcode
        return data[:begin] + bytes([rng.randrange(256)]) + data[begin + 1 :]
    if kind == 6:  # the end is missing
        return data[:at]
    if kind == 7:  # bytes are lost
        return data[:at] + data[at + rng.choice((1, 8, 100)) :]
    if kind == 8:  # bytes are added
        return data[:at] + rng.randbytes(rng.choice((1, 8, 100))) + data[at:]
    if kind == 9:  # zeros, as a crashed disk leaves them
        size = rng.choice((4, 64, 512))
        return data[:at] + bytes(min(size, len(data) - at)) + data[at + size :]
    inside = rng.randrange(begin + HEAD.size, end) if end > begin + HEAD.size else begin
    return data[:inside] + rng.randbytes(1) + data[inside + 1 :]  # a byte of the content


def messages(path: Path) -> dict[str, int]:
    return {name: topic.count for name, topic in inspect(path).topics.items() if topic.count}


def assert_unharmed(data: bytes, original: bytes, note: str) -> None:
    """Assert that a file that was called whole is: a CRC of zero means "not computed"."""
    changed = [i for i, (a, b) in enumerate(zip(data, original, strict=False)) if a != b]
    assert len(data) == len(original), note
    assert all(data[i] == 0 for i in changed) and len(changed) <= 4, note


def judge(path: Path, original: bytes, counts: dict[str, int], out: Path, note: str) -> None:
    """Run everything over one mutation and compare what it says with what is there."""
    data = path.read_bytes()
    report = inspect(path)
    if report.code == WHOLE and data != original:
        assert_unharmed(data, original, note)
    result = salvage(path, out)
    if result.saved:
        assert messages(out) == {n: t.count for n, t in result.saved.topics.items() if t.count}
        assert result.saved.messages >= report.messages, note
        out.unlink()
    else:
        assert report.code == UNUSABLE, note
        assert not out.exists()
    for topic, count in counts.items():
        told: list[str] = []
        try:
            parts = list(iter_columns(path, topic, ['log_time'], on_problem=told.append))
        except BagError:
            continue
        found = sum(len(part['log_time']) for part in parts)
        assert found == count or told, f'{note}: {topic} gives {found} of {count}, and no word'


def run(command: Callable[[list[str]], int], *args: object) -> tuple[int, str, str]:
    """Run a command; return its exit code and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = command([str(arg) for arg in args])
    return code, out.getvalue(), err.getvalue()


def read_by_others(path: Path) -> Counter[str]:
    """Count messages by topic with the reference library."""
    reader = pytest.importorskip('mcap.reader')
    with path.open('rb') as stream:
        made = reader.make_reader(stream, validate_crcs=True)
        return Counter(channel.topic for _, channel, _ in made.iter_messages())


def assert_container_whole(path: Path, note: str) -> None:
    """Assert that nothing is wrong with a saved file but what its messages say themselves."""
    _, shown, _ = run(verify.main, path, '--json')
    (report,) = json.loads(shown)
    said = ('stamps', 'definition', 'is encoded as', 'not plain CDR')
    assert all(any(word in text for word in said) for text in report['problems']), (note, report)


def samples_of(outcome: dict[str, str], counts: dict[str, int]) -> int:
    """Return how many samples a verdict should rest on."""
    _, valve, _ = outcome['bag'].partition('#')
    return ROWS if valve else counts.get('/measurement', 0)


def judge_commands(
    path: Path, original: bytes, counts: dict[str, int], out: Path, note: str
) -> None:
    """Run verify, recover and replay over one mutation as a user does."""
    code, shown, err = run(verify.main, path, '--json')
    (report,) = json.loads(shown)
    assert report['verdict'] == {WHOLE: 'whole', LOSSY: 'lossy', UNUSABLE: 'unusable'}[code], note
    data = path.read_bytes()
    if code == WHOLE and data != original:
        assert_unharmed(data, original, note)
    readable = report['messages']
    code, shown, err = run(recover.main, path, '--out', out)
    assert code in (WHOLE, LOSSY, UNUSABLE), note
    if out.exists():
        saved = read_by_others(out)
        assert f'saved {saved.total()} messages' in shown, note
        assert saved.total() >= readable, note
        assert_container_whole(out, note)
        out.unlink()
    else:
        assert code == UNUSABLE, note
    result = path.with_name('result.json')
    code, shown, err = run(replay.main, path, '--mode', 'paper', '--jobs', 1, '--out', result)
    for outcome in json.loads(result.read_text()) if result.exists() else []:
        found, expected = outcome['samples'], samples_of(outcome, counts)
        if code == 0 and data != original:
            assert found == expected, f'{note}: {found} of {expected} replayed, and no word'
        assert outcome['error'] or found == expected or 'warning' in err, note
    result.unlink(missing_ok=True)


def fuzz(folder: Path, seed: int, count: int) -> None:
    warm_up([Plan('paper')])  # no mutation pays for what is compiled once
    rng = random.Random(seed)
    originals = [(path.name, path.read_bytes(), messages(path)) for path in seeds(folder)]
    for number in range(count):
        name, original, counts = originals[number % len(originals)]
        data = original
        for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
            data = mutated(data, rng)
        path = folder / 'mutation.mcap'
        path.write_bytes(data)
        note = f'{name}, seed {seed}, {number}'
        examine = judge if number // len(originals) % EVERY else judge_commands
        began = time.process_time()
        examine(path, original, counts, folder / 'saved.mcap', note)
        assert time.process_time() - began < SECONDS, note


def test_mutations_with_a_fixed_seed(tmp_path):
    fuzz(tmp_path, FIXED, COUNT)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_thousands_of_mutations(tmp_path):
    """The long run of `make fuzz`."""
    seed = int(os.environ.get('FUZZ_SEED', '0')) or int(time.time())
    print(f'seed {seed}')
    fuzz(tmp_path, seed, int(os.environ.get('FUZZ_COUNT', '6000')))
