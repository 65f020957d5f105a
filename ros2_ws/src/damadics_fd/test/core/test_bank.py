# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A bank of valves: the same bits as one monitor a valve, in every mode, moved or not."""

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.core.bank import ahead
from damadics_fd.core.bank.approximators import Approximators
from damadics_fd.core.bank.bank import Bank
from damadics_fd.core.bank.lazily import copies
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.monitor import monitor_for
from damadics_fd.core.quality import Reason
from damadics_fd.core.result import events_in
from damadics_fd.core.sample import COLUMNS, SIGNALS
from damadics_fd.core.scada.naming.looks import Looks
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import NO_CLASSES
from damadics_plant import simulate

from .synthetic import valve
from .test_paper import recording

SLOW = {'t_on': 60.0, 't_w': 60.0, 't_learn': 400.0}


def moving(seed):
    """Return a moving stem with bad samples, which jams at the end."""
    columns = recording(seed=seed)
    columns['x1'][2500:] += np.where(np.arange(1500) % 40 < 20, 0.2, 0.0)
    return columns


def rubbing(seed):
    """Return a valve whose friction grows sixfold, with bad samples."""
    columns = valve(
        72.0, friction=lambda t: 0.011 * np.where(t < 66.0, 1.0, 6.0), noise=2e-5, seed=seed
    )
    columns['ps'][500:503] = math.nan
    columns['stamp'][900] = columns['stamp'][899]
    return columns


def controlled(seed):
    """Return signals of a control room: the supply of air fails late."""
    columns = simulate('f16_B', rate=1.0, duration=1000.0, noise=True, seed=seed)
    columns = {name: np.array(columns[name]) for name in COLUMNS}
    columns['p1'][700] = math.nan
    columns['stamp'][500:] += 40_000_000_000  # a gap that starts the models afresh
    return columns


CASES = {
    'paper': (moving, {}, {'decide_m': 1}),
    'monitor': (rubbing, {}, {'mass': 1.9, 'latch': False}),
    'scada': (controlled, SLOW, SLOW | {'false_alarm_days': 1.0}),
}


def settings_of(mode):
    """Return the settings of three valves, two of them alike."""
    _, one, other = CASES[mode]
    first = Settings.for_mode(mode, **one)
    return [first, Settings.for_mode(mode, **other), first]


@pytest.fixture(scope='module', params=CASES)
def case(request):
    """Run three valves each by its own monitor."""
    make, _, _ = CASES[request.param]
    settings = settings_of(request.param)
    columns = [make(seed) for seed in (1, 2, 3)]
    results = [monitor_for(s).run(c) for s, c in zip(settings, columns, strict=True)]
    return settings, columns, results


def mixed(columns, seed=0):
    """Return the rows of all valves in random order, those of each valve in order of time."""
    lengths = [len(c['stamp']) for c in columns]
    valve = np.random.default_rng(seed).permutation(np.repeat(np.arange(len(columns)), lengths))
    rows = {name: np.empty(len(valve), columns[0][name].dtype) for name in COLUMNS}
    for v, own in enumerate(columns):
        for name in COLUMNS:
            rows[name][valve == v] = own[name]
    return valve, rows


def fed(bank, valve, rows, size=777, of=lambda v: v):
    """Feed a bank block by block; return reasons and the decisions with news of each valve."""
    reasons, news = [], {v: [] for v in range(3)}
    for first in range(0, len(valve), size):
        part = slice(first, first + size)
        numbers = np.array([of(v) for v in valve[part]])
        changes = bank.take(
            numbers, rows['stamp'][part], {name: rows[name][part] for name in SIGNALS}
        )
        reasons.append(changes.reason)
        assert np.all(np.diff(changes.row) > 0)
        for row, decision in zip(changes.row, changes.decisions, strict=True):
            news[int(valve[part][row])].append(Decision(*decision.item()))
    return np.concatenate(reasons), news


def same(bank, v, result):
    """Compare the state of a valve with that of its own monitor, byte by byte."""
    detector = bank.detector(v)
    assert detector.state.tobytes() == result.detector.state.tobytes()
    assert detector.signature.state.tobytes() == result.detector.signature.state.tobytes()
    assert str(detector.decision) == str(result.detector.decision)
    assert bank.counters(v) == result.counters
    assert bank.status(v) == result.estimator.status
    assert bank.failing(v) == result.estimator.failing


def test_interleaved_valves_get_the_bits_of_their_own_monitors(case):
    settings, columns, results = case
    number, rows = mixed(columns)
    bank = Bank(settings)
    reasons, news = fed(bank, number, rows)
    for v, result in enumerate(results):
        assert reasons[number == v].tolist() == result.reason.tolist()
        judged = result.decisions[result.accepted]
        # what mode scada says of causes in events of a recording, it says live as judgements
        events = [e for d in news[v] for e in d.events]
        assert list(map(repr, events)) == list(map(repr, events_in(judged)))  # NaN: not known
        same(bank, v, result)
        due = judged['transitions'] != 0
        for name in ('fault', 'state', 'level'):
            due |= np.diff(judged[name], prepend=np.zeros(1, judged[name].dtype)) != 0
        shown = [Decision(*row.item()) for row in judged[due]]
        assert [str(decision) for decision in news[v]] == [str(decision) for decision in shown]
        told = bank.judgement(v)
        assert told is bank.judgement(v)
        if bank.mode == 'scada':
            assert str(told) == str(Looks().judge(result.estimator.monitor))
        else:
            assert told is None
    assert any(result.detections for result in results), 'no fault is in this test'


def test_a_state_moves_to_another_bank_in_the_middle(case):
    settings, columns, results = case
    number, rows = mixed(columns, seed=1)
    for share in (0.2, 0.7):  # while it learns, and while it monitors
        half = int(share * len(number))
        bank, other = Bank(settings), Bank(settings[::-1])
        fed(bank, number[:half], {name: column[:half] for name, column in rows.items()})
        for v in range(3):
            other.restore_bytes(2 - v, bank.tobytes(v))
            assert other.tobytes(2 - v) == bank.tobytes(v)
        rest = {name: column[half:] for name, column in rows.items()}
        fed(other, number[half:], rest, of=lambda v: 2 - v)
        for v, result in enumerate(results):
            detector = other.detector(2 - v)
            assert detector.state.tobytes() == result.detector.state.tobytes()
            assert str(detector.decision) == str(result.detector.decision)
            assert other.counters(2 - v) == result.counters


def test_what_was_learned_comes_and_goes_by_valve(case):
    settings, columns, results = case
    bank = Bank(settings)
    number, rows = mixed(columns)
    fed(bank, number, rows)
    learned = json.loads(json.dumps(bank.learned(0)))
    assert learned == json.loads(json.dumps(results[0].estimator.learned()))
    untouched = bank.tobytes(2)
    if settings[0].mode != 'paper':
        bank.relearn(0)
        with pytest.raises(ValueError, match='nothing to save'):
            bank.learned(0)
    bank.restore(0, learned)
    assert bank.learned(0) == learned
    assert bank.counters(0) == results[0].counters
    with pytest.raises(ValueError, match='learned state'):
        bank.restore(0, {'nonsense': 1.0})
    bank.reset(0)
    assert bank.counters(0)['accepted'] == 0
    assert bank.tobytes(2) == untouched


def test_valves_of_a_control_room_take_memory_where_something_is_written():
    settings = [Settings.for_mode('scada', **SLOW)] * 400
    chain = monitor_for(settings[0])
    chain.run(controlled(1))
    learned = chain.learned()
    bank = Bank(settings)
    bank.restore(0, learned)  # loads what is loaded once
    before = resident()
    for v in range(1, 400):
        bank.restore(v, learned)
    assert resident() - before < 399 * 20_000
    columns = controlled(2)
    one = {name: column[:3] for name, column in columns.items() if name != 'stamp'}
    bank.take(np.zeros(3, np.int64), columns['stamp'][:3], one)
    seen = bank.tobytes(0)
    assert seen != bank.tobytes(1)
    bank.restore(0, learned)
    fresh = Bank(settings[:1])
    fresh.restore(0, learned)
    assert bank._held.states[:1].tobytes() == fresh._held.states[:1].tobytes()


def resident():
    """Return the resident memory of this process [B]."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGESIZE')


def test_copies_are_those_that_numpy_makes():
    first = monitor_for(Settings.for_mode('monitor')).detector.signature.state
    assert copies(first, 5).tobytes() == np.repeat(first, 5).tobytes()
    assert copies(first, 0).shape == (0,)


def small(count=2):
    return Bank([Settings.for_mode('paper')] * count)


COLUMN = np.full(3, 0.5)
GOOD = {'cv': COLUMN, 'x1': COLUMN}


@pytest.mark.parametrize(
    ('valve', 'stamp', 'signals', 'text'),
    [
        ([0, 2, 1], [1, 2, 3], GOOD, 'valve 2 is not in the bank of 2'),
        ([0, -1, 1], [1, 2, 3], GOOD, 'valve -1 is not in the bank'),
        ([0, 1], [1, 2, 3], GOOD, 'stamp must be a column of 2 int64'),
        ([0, 1, 1], [1.0, 2.0, 3.0], GOOD, 'stamp must be a column of 3 int64, not float64'),
        ([0.0, 1.0, 1.0], [1, 2, 3], GOOD, 'valve must be a column of whole numbers'),
        ([[0, 1, 1]], [[1, 2, 3]], GOOD, 'valve must be a column'),
        ([0, 1, 1], [1, 2, 3], GOOD | {'x1': COLUMN[:2]}, 'x1 must be a column of 3 numbers'),
        ([0, 1, 1], [1, 2, 3], GOOD | {'x2': COLUMN}, 'no such signal: x2'),
        ([0, 1, 1], [1, 2, 3], GOOD | {'ps': np.array(['a'] * 3)}, 'ps must be a column'),
    ],
)
def test_rows_that_do_not_fit_are_refused_whole(valve, stamp, signals, text):
    bank = small()
    before = bank.tobytes(0), bank.tobytes(1)
    with pytest.raises(ValueError, match=text):
        bank.take(np.array(valve), np.array(stamp), signals)
    assert (bank.tobytes(0), bank.tobytes(1)) == before


def test_bad_samples_touch_no_other_valve_and_doubled_rows_are_duplicates():
    bank = small()
    x1 = np.array([0.5, math.nan, 0.5, 0.5])
    changes = bank.take(
        np.array([0, 1, 0, 0], np.uint32), np.array([5, 5, 5, 7]), {'cv': x1 * 0 + 0.5, 'x1': x1}
    )
    reasons = [Reason.ACCEPTED, Reason.NOT_FINITE, Reason.DUPLICATE, Reason.ACCEPTED]
    assert changes.reason.tolist() == reasons
    assert bank.counters(1)['accepted'] == 0
    empty = bank.take(np.zeros(0, np.int64), np.zeros(0, np.int64), {})
    assert len(empty.reason) == len(empty.row) == 0


def test_banks_refuse_mixed_modes_and_foreign_states():
    with pytest.raises(ValueError, match='one mode'):
        Bank([Settings.for_mode('paper'), Settings.for_mode('monitor')])
    with pytest.raises(ValueError, match='no valve'):
        Bank([])
    bank = small()
    for wrong in (b'', bank.tobytes(0)[:-1], b'x' + bank.tobytes(0)[1:]):
        with pytest.raises(ValueError, match='another mode or version'):
            bank.restore_bytes(1, wrong)
    with pytest.raises(ValueError, match='another mode or version'):
        Bank([Settings.for_mode('monitor')]).restore_bytes(0, bank.tobytes(0))
    with pytest.raises(IndexError):
        bank.detector(2)


@pytest.fixture
def small_cache(monkeypatch):
    """Let three valves be too many for the cache."""
    monkeypatch.setattr(ahead, 'CACHE', 1000)


def test_what_is_fetched_ahead_are_the_records_of_the_next_valve(small_cache):
    held = Approximators(settings_of('monitor'), NO_CLASSES)
    for v in range(3):
        seen = set()
        for first, step in held.ahead.tolist():
            address = first + v * step
            (k,) = (
                k
                for k, records in enumerate(held.state_arrays())
                if 0 <= address - records[v : v + 1].ctypes.data < records.itemsize
            )
            seen.add(k)
        assert len(seen) == len(held.state_arrays()) - 1, 'all but the samples refused last'
    held.ahead[:] = 12_345  # a place that is not the process's: asking for it changes nothing
    ahead.fetch(held.ahead, 2)


def test_few_valves_stay_in_the_cache():
    assert not len(Approximators(settings_of('monitor'), NO_CLASSES).ahead)


def test_valves_that_do_not_fit_the_cache_get_the_same_bits(monkeypatch):
    number, rows = mixed([recording(800, seed=seed) for seed in (1, 2, 3)])
    found = []
    for cache in (0, ahead.CACHE):
        monkeypatch.setattr(ahead, 'CACHE', cache)
        bank = Bank(settings_of('paper'))
        reasons, news = fed(bank, number, rows)
        states = [bank.detector(v).signature.state.tolist() for v in range(3)]
        found.append((reasons.tolist(), news, bank.decisions.tolist(), states))
    assert str(found[0]) == str(found[1])
