# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Topic `signature` of running nodes: names a fault, as in replay, also after a restart; tells how
long a stored trend takes to its limit.
"""

import numpy as np
import pytest
from damadics_bringup.processes import parameters
from damadics_fd.core.decision.alarm import NE107
from damadics_fd.core.monitor import run
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import CAUSES, known
from damadics_fd.ros import qos
from damadics_fd.store.references import Reference, save_reference
from damadics_fd.store.trends import TrendFile, series_name
from damadics_msgs.msg import FaultEvent, FaultFlag, Float64Stamped, Signature
from damadics_plant import simulate
from diagnostic_msgs.msg import DiagnosticArray

pytestmark = pytest.mark.ros
RATE = 100.0  # Hz
# learning is shortened to what fits into the 70 s before the fault of the scenario
QUICK = {'mode': 'monitor', 'sample_rate': RATE, 't_learn': 30.0, 'verify': 10.0}
SETTINGS = Settings.for_mode('monitor', **{k: v for k, v in QUICK.items() if k != 'mode'})


@pytest.fixture
def chain(processes, peer):
    """Start estimator and detector in monitor mode and listen to the signature."""
    for name in ('estimator', 'detector'):
        processes.start('damadics_fd', name, parameters(**QUICK))
    peer.listen(Float64Stamped, 'threshold', qos.SAMPLES)
    peer.listen(Signature, 'signature', qos.FLAG)
    await_chain(peer)
    return peer


def await_chain(peer):
    graph = peer.node
    assert peer.wait(
        lambda: (
            graph.count_subscribers('/estimate') == 1
            and graph.count_subscribers('/measurement') == 1
            and graph.count_publishers('/signature') == 1
        ),
        60.0,
    ), 'no node started'
    peer.await_met('estimator', 'detector')


def stamp_of(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def send(peer, columns: dict[str, np.ndarray]) -> None:
    """Send samples no faster than the chain takes them: the queue of signatures holds one."""
    rows = zip(columns['stamp'].tolist(), *(columns[s].tolist() for s in SIGNALS), strict=True)
    before = len(peer.got['threshold'])
    for n, (stamp, *values) in enumerate(rows, 1):
        peer.send(stamp, **dict(zip(SIGNALS, values, strict=True)))
        if n % RATE == 0:
            assert peer.wait(lambda n=n: len(peer.got['threshold']) >= before + n), 'samples lost'


def test_a_fault_gets_its_cause_live_and_replay_says_the_same(chain):
    flags = chain.listen(FaultFlag, 'fault_flag', qos.FLAG)
    events = chain.listen(FaultEvent, 'fault_event', qos.EVENTS)
    columns = simulate('random_spring', rate=RATE, model='lugre', duration=120.0, noise=True)
    send(chain, dict(columns))
    signatures = chain.got['signature']
    assert chain.wait(lambda: signatures and stamp_of(signatures[-1]) > 118e9)
    assert chain.wait(lambda: events and events[-1].cause and events[-1].level == flags[-1].level)
    last = signatures[-1]
    assert last.state == Signature.STATE_ALARM
    assert last.source == Signature.SOURCE_APPROXIMATOR
    assert last.family == Signature.FAMILY_ELASTIC
    assert last.cause == Signature.CAUSE_SPRING_STIFFER
    assert last.value == pytest.approx(1.0, abs=0.05) and last.confidence > 0.95
    assert np.isnan(last.time_to_limit).all(), 'there is no trend of two minutes'
    told = events[-1]
    assert told.cause == 'spring_stiffer' and told.level == flags[-1].level
    assert told.level >= FaultFlag.NE107_OUT_OF_SPECIFICATION, 'the class of the cause'
    assert 'stiffer' in told.text and NE107[told.level] in told.text
    decisions = run(columns, SETTINGS).decisions
    row_of = {stamp: row for row, stamp in enumerate(decisions['stamp'].tolist())}
    assert len(signatures) > 100
    for message in signatures:
        replayed = decisions[row_of[stamp_of(message)]]
        assert message.cause == replayed['cause'], CAUSES[message.cause]
        live = (message.value, message.std, message.confidence)
        again = known(replayed['strength'], replayed['spread'], replayed['confidence'])
        np.testing.assert_array_equal(live, again)


def restart(peer, processes, *names):
    for name in names:
        processes.end(name)
    graph = peer.node
    assert peer.wait(
        lambda: (
            graph.count_publishers('/signature') == 0
            and ('estimator' not in names or graph.count_publishers('/estimate') == 0)
        )
    )
    peer.got['signature'].clear()
    for name in names:
        processes.start('damadics_fd', name, parameters(**QUICK))
    await_chain(peer)


def test_a_restarted_detector_explains_a_fault_at_once(chain, processes):
    columns = simulate(
        'random_spring', rate=RATE, model='lugre', duration=110.0, noise=True, seed=3
    )
    early = columns['stamp'] < 65e9
    send(chain, {name: columns[name][early] for name in ('stamp', *SIGNALS)})
    signatures = chain.got['signature']
    assert chain.wait(lambda: signatures[-1].state == Signature.STATE_MONITOR), signatures[-1]
    learned = signatures[-1].theta
    restart(chain, processes, 'detector')
    late = {name: columns[name][~early] for name in ('stamp', *SIGNALS)}
    send(chain, late)
    assert min(m.state for m in signatures) >= Signature.STATE_MONITOR
    assert signatures[0].theta.tolist() == learned.tolist()
    assert signatures[-1].cause == Signature.CAUSE_SPRING_STIFFER
    restart(chain, processes, 'estimator', 'detector')
    again = {**late, 'stamp': late['stamp'] - late['stamp'][0]}
    send(chain, {name: values[:400] for name, values in again.items()})
    assert signatures[-1].state == Signature.STATE_LEARN, 'another run was judged by the old one'


NOW = 1_780_000_000_000_000_000  # ns, a plant's clock
DAY = 86400.0
SLOPES = (-0.001, 0.0, 0.05)  # per day: spring, preload [N], friction
DEVIATIONS = (0.0005, 2.0, 0.02)
ACTUATOR = 'LV-101'


def store_history(folder, learned) -> TrendFile:
    """Keep a reference and a trend of 20 days before NOW that leads to where the valve is now."""
    save_reference(
        folder / f'{ACTUATOR}.signature',
        Reference(
            ACTUATOR, {}, SETTINGS.to_dict(), learned, source='live', last_stamp=NOW - 10**9
        ),
    )
    trend = TrendFile(folder, ACTUATOR, series_name(learned))
    rng = np.random.default_rng(8)
    for days in np.linspace(-20.0, -0.02, 80):
        change = np.multiply(SLOPES, days) + DEVIATIONS * rng.standard_normal(3)
        assert trend.add(NOW + round(days * DAY * 1e9), change.tolist(), DEVIATIONS)
    return trend


def test_a_stored_trend_is_published_with_its_band_and_the_time_to_its_limit(
    processes,
    peer,
    tmp_path,
):
    columns = simulate(
        'random_spring', rate=RATE, model='lugre', duration=68.0, noise=True, seed=3
    )  # its fault comes after 70 s
    learned = run(columns, SETTINGS).detector.signature.save()
    trend = store_history(tmp_path / 'signature', learned)
    before = trend.path.read_text().count('\n')
    signatures = peer.listen(Signature, 'signature', qos.FLAG)
    reports = peer.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
    peer.listen(Float64Stamped, 'threshold', qos.SAMPLES)
    processes.start('damadics_fd', 'estimator', parameters(**QUICK, actuator=ACTUATOR))
    processes.start(
        'damadics_fd',
        'detector',
        parameters(**QUICK, actuator=ACTUATOR, signature_folder=str(trend.path.parent)),
    )
    await_chain(peer)
    send(peer, dict(columns) | {'stamp': columns['stamp'] + NOW})
    first, last = signatures[0], signatures[-1]
    assert first.state == last.state == Signature.STATE_MONITOR, 'the reference was not taken up'
    assert first.theta.tolist() == learned['theta'][:4]
    for message in (first, last):
        # the slope of 80 points over 20 days has 1/52 of their deviation per day
        assert np.all(np.abs(np.subtract(message.trend, SLOPES)) < np.multiply(DEVIATIONS, 4 / 52))
        assert message.limit[0] == -0.1 and message.limit[2] == 3.0
        expected, earliest, latest = (
            np.array(values) / DAY
            for values in (
                message.time_to_limit,
                message.time_to_limit_earliest,
                message.time_to_limit_latest,
            )
        )
        assert expected[0] == pytest.approx(100.0, rel=0.05)
        assert expected[2] == pytest.approx(60.0, rel=0.05)
        for k in (0, 2):
            assert 0.9 * expected[k] < earliest[k] < expected[k] < latest[k] < 1.1 * expected[k]
        assert earliest[1] > 365.0, 'the preload does not move'
    assert np.all(np.abs(last.change) < 4.0 * np.array(last.change_std)), 'nothing has changed'
    assert 1e-4 < last.change_std[0] < 0.02 and 1e-3 < last.change_std[2] < 0.2
    assert trend.path.read_text().count('\n') == before + 1, 'one point in 15 minutes'

    def sentences() -> dict[str, str]:
        status = [s for m in reports for s in m.status if 'detector' in s.name][-1:]
        return {v.key: v.value for s in status for v in s.values if v.key.startswith('Trend')}

    assert peer.wait(lambda: len(sentences()) == 3)
    words = sentences()['Trend of spring']
    assert words.startswith('spring ') and '+-' in words
    assert 'limit -0.1 in ' in words and ' days (' in words
