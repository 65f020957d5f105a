# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topic `signature` of running nodes: names a fault, as in replay, also after a restart."""

import numpy as np
import pytest
from damadics_bringup.processes import parameters
from damadics_fd.core.pipeline import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature_types import CAUSES, known
from damadics_fd.ros import qos
from damadics_msgs.msg import Float64Stamped, Measurement, Signature
from damadics_plant import simulate

pytestmark = pytest.mark.ros
SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
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
    assert peer.wait(lambda: graph.count_subscribers('/estimate') == 1
                     and graph.count_subscribers('/measurement') == 1
                     and graph.count_publishers('/signature') == 1, 60.0), 'no node started'
    peer.wait(lambda: False, 0.5)


def stamp_of(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def send(peer, columns: dict[str, np.ndarray]) -> None:
    """Send samples no faster than the chain takes them."""
    rows = zip(columns['stamp'].tolist(), *(columns[s].tolist() for s in SIGNALS), strict=True)
    before = len(peer.got['threshold'])
    for n, (stamp, *values) in enumerate(rows, 1):
        peer.send(stamp, **dict(zip(SIGNALS, values, strict=True)))
        if n % 200 == 0:
            assert peer.wait(lambda n=n: len(peer.got['threshold']) >= before + n), 'samples lost'


def test_a_fault_of_the_running_plant_gets_its_cause_and_replay_says_the_same(chain, processes):
    measured = chain.listen(Measurement, 'measurement', qos.SAMPLES)
    processes.start('damadics_plant', 'plant', parameters(
        scenario='random_spring', model='lugre', noise=True, rate=RATE, duration=120.0,
        real_time_factor=8.0, wait_for_subscribers=2))
    signatures = chain.got['signature']
    assert chain.wait(lambda: signatures and stamp_of(signatures[-1]) > 118e9, 100.0)
    last = signatures[-1]
    assert last.state == Signature.STATE_ALARM
    assert last.source == Signature.SOURCE_APPROXIMATOR
    assert last.family == Signature.FAMILY_ELASTIC
    assert last.cause == Signature.CAUSE_SPRING_STIFFER
    assert last.value == pytest.approx(1.0, abs=0.05) and last.confidence > 0.95
    assert np.isnan(last.time_to_limit).all(), 'there is no trend of two minutes'
    columns = {'stamp': np.array([stamp_of(m) for m in measured])}
    columns |= {name: np.array([getattr(m, name) for m in measured]) for name in SIGNALS}
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
    assert peer.wait(lambda: graph.count_publishers('/signature') == 0
                     and ('estimator' not in names or graph.count_publishers('/estimate') == 0))
    peer.got['signature'].clear()
    for name in names:
        processes.start('damadics_fd', name, parameters(**QUICK))
    await_chain(peer)
    peer.wait(lambda: False, 2.0)  # the estimator, too, has to find the new detector


def test_a_restarted_detector_explains_a_fault_at_once(chain, processes):
    columns = simulate('random_spring', rate=RATE, model='lugre', duration=110.0, noise=True,
                       seed=3)
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
