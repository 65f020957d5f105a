# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mode scada on valves that are not the benchmark's, by a generator of its own."""

import json
import math

import numpy as np
import pytest
from damadics_fd.commands.commission import command as commission
from damadics_fd.commands.replay import replay
from damadics_fd.core.scada.estimator import scada_settings
from damadics_fd.core.scada.laws.identify import identify
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.state import Reference
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import OK, REFUSED, FaultFree
from fluids import control_valve
from foreign_valve import VAPOUR, WATER, Kind, capacity, load, mass_flow, record

SHEET = Settings.for_mode('scada')
HOURS = 4 * 3600
AT = 2400
KINDS = {
    'Kv 40': Kind(kv=40.0),
    'Kv 480, linear': Kind(kv=480.0, trim='linear'),
    'ten times slower': Kind(air=0.1),
    'gas at 800 kPa, air opens': Kind(medium='gas', p1=8e5, p2=5e5, air_to='open'),
    '10 MPa': Kind(p1=1e7, p2=8.5e6),
}


def monitor_of(kind):
    day = record(kind, load(HOURS, 1), 1)
    found = identify([FaultFree('day', day)], SHEET)
    assert found.verdict == OK, found.report
    reference = Reference.read(found.learned, 'learned')
    settings = scada_settings(SHEET.replace(**found.settings))
    return lambda: ScadaMonitor(settings, reference)


def spike_in_two_rows(columns, at):
    """Put a wrong position and, with the next sample, a wrong flow into a recording."""
    for i in at:
        columns['x1'][i] += 0.2
        columns['flow'][i + 1] *= 0.7


@pytest.mark.parametrize('name', KINDS)
def test_a_foreign_valve_is_learned_and_its_faults_are_found(name):
    kind = KINDS[name]
    fresh = monitor_of(kind)
    quiet = record(kind, load(HOURS, 2), 2)
    spike_in_two_rows(quiet, at=range(1000, HOURS, 1000))
    assert not fresh().run(quiet)['alarm'].any()
    for fault, strength, within in ((19, 0.25, 5), (11, 0.5, 5), (13, 0.25, 5)):
        found = fresh()
        trace = found.run(record(kind, load(AT + 300, 3), 3, fault, strength, AT))
        first = trace['t'][trace['alarm']]
        assert len(first)
        assert 0 <= first[0] - AT <= within
        if fault != 11:  # gone after seconds: too short to be named
            isolation = found.isolate()
            assert isolation is not None
            assert fault in isolation.candidates


def behind(flow, lag):
    """Return a flow as a slow meter shows it."""
    shown = flow.copy()
    for k in range(1, len(flow)):
        shown[k] = shown[k - 1] + (1.0 - math.exp(-1.0 / lag)) * (flow[k] - shown[k - 1])
    return shown


def test_a_wrong_position_leaves_no_trace_in_what_a_slow_flow_meter_should_show():
    kind = KINDS['Kv 480, linear']
    day, quiet = record(kind, load(HOURS, 1), 1), record(kind, load(HOURS, 2), 2)
    for columns in (day, quiet):
        columns['flow'] = behind(columns['flow'], 4.0)
    found = identify([FaultFree('day', day)], SHEET)
    reference = Reference.read(found.learned, 'learned')
    assert reference['flow_law']['lag_s'] == pytest.approx(4.0, abs=1.5)
    quiet['x1'][500::500] = np.clip(quiet['x1'][500::500] - 0.3, 0.0, 1.0)
    monitor = ScadaMonitor(scada_settings(SHEET.replace(**found.settings)), reference)
    trace = monitor.run(quiet)
    assert not trace['alarm'].any()
    assert trace['ratio'][501::500].max() < 0.4  # of the limit, with the sample after it


def test_a_slow_drift_is_followed_and_told():
    kind = Kind(kv=480.0, trim='linear')
    found = monitor_of(kind)()
    n = 10 * 3600
    day = record(kind, load(n, 5), 5)
    share = np.minimum(np.arange(n) / (8.0 * 3600.0), 1.0)
    day['x1'] = np.clip(day['x1'] + 0.009 * share, 0.0, 1.0)
    day['flow'] *= 1.0 + 0.09 * share
    assert not found.run(day)['alarm'].any()
    assert len(found.drifts()) == 2
    assert 'the stem has drifted by +0.' in found.drifts()[0]


@pytest.mark.parametrize(
    ('spread', 'noise'), [(0.12, 2.83e-3), (0.24, 1.414e-3)], ids=['noise', 'motion']
)
def test_twice_the_noise_or_the_motion_that_was_learned_is_no_fault(spread, noise):
    kind = Kind()
    found = monitor_of(kind)()
    later = record(kind, load(HOURS, 2, spread=spread), 2, noise=noise)
    assert not found.run(later)['alarm'].any()
    if noise > 2e-3:
        assert any('times as noisy as learned' in text for text in found.drifts())
    faulty = record(kind, load(AT + 300, 3, spread=spread), 3, 19, 0.25, AT, noise=noise)
    found = monitor_of(kind)()
    alarms = found.run(faulty)
    first = alarms['t'][alarms['alarm']]
    assert len(first)
    assert 0 <= first[0] - AT <= 10


@pytest.mark.parametrize('p2', [2.6e6, 0.4e6])
def test_the_generator_flows_as_iec_60534_says(p2):
    kind = Kind(kv=100.0, trim='linear')
    x, p1 = np.array([0.4]), np.array([3.5e6])
    flow = mass_flow(kind, x, p1, np.array([p2]))[0]
    needed = control_valve.size_control_valve_l(
        rho=WATER, Psat=VAPOUR, Pc=22.064e6, mu=6e-4, P1=3.5e6, P2=p2, Q=flow / WATER, FL=0.9
    )
    assert needed == pytest.approx(capacity(kind, x)[0], rel=0.03)
    gas = Kind(kv=100.0, trim='linear', medium='gas')
    flow = mass_flow(gas, x, np.array([8e5]), np.array([5e5]))[0]
    normal = flow / 28.96 * 8314.46 * 273.15 / 101325.0  # m3/s at 0 degC
    needed = control_valve.size_control_valve_g(
        T=316.15, MW=28.96, mu=1.9e-5, gamma=1.4, Z=1.0, P1=8e5, P2=5e5, Q=normal, FL=0.9, xT=0.7
    )
    assert needed == pytest.approx(capacity(gas, x)[0], rel=0.05)


@pytest.mark.parametrize(
    ('what', 'said'),
    [
        ('stuck', 'the stem moves by'),
        ('gain 0.6', 'the stem moves by 0.6'),
        ('closed', 'travelled'),
    ],
)
def test_what_cannot_be_a_valve_that_works_is_refused(what, said):
    day = record(Kind(), load(3600, 4), 4)
    rng = np.random.default_rng(1)
    if what == 'stuck':
        day['x1'] = 0.5 + rng.normal(size=3600) * 1.4e-3
    elif what == 'gain 0.6':
        day['x1'] = 0.6 * day['x1']
    else:
        day['cv'] = np.ones(3600)
        day['x1'] = np.clip(1.0 - np.abs(rng.normal(size=3600) * 1.4e-3), 0.0, 1.0)
    found = identify([FaultFree('day', day)], SHEET)
    assert found.verdict == REFUSED
    assert said in found.report[0]


def table(path, columns):
    names = ('cv', 'x1', 'p1', 'p2', 't1', 'flow')
    rows = np.column_stack([columns['stamp'] * 1e-9, *(columns[name] for name in names)])
    np.savetxt(path, rows, delimiter=',', header=','.join(('t', *names)), comments='', fmt='%.9g')
    return str(path)


def test_a_valve_is_commissioned_from_a_table_and_its_fault_named(tmp_path, capsys):
    kind = Kind(kv=60.0, trim='linear')
    day = table(tmp_path / 'day.csv', record(kind, load(HOURS // 2, 1), 1))
    kept = tmp_path / 'lv7'
    words = [day, '--mode', 'scada', '--actuator', 'LV7', '--reference', str(kept)]
    assert commission.main([*words, '--out', str(tmp_path / 'lv7.yaml')]) == 0
    said = capsys.readouterr().out
    for line in ('stem: learned at', 'flow: liquid, identified', 'Kv ', 'found within'):
        assert line in said
    assert 'verdict: ok' in said
    later = table(tmp_path / 'later.csv', record(kind, load(AT + 300, 3), 3, 19, 0.25, AT))
    out = tmp_path / 'found.json'
    words = [later, '--mode', 'scada', '--reference', str(kept), '--out', str(out)]
    assert replay.main(words) == 0
    [found] = json.loads(out.read_text())[0]['detections']
    assert AT <= found['t'] <= AT + 5
    assert found['test'].startswith('r2/')
    assert 'f19' in found['candidates'].split(', ')
    assert found['cause'] == found['candidates'].replace(', ', ' or ')
    assert 'flow sensor' in found['text']


def test_cv_and_position_alone_show_the_stem():
    kind = Kind(air=0.2)  # a quick positioner hides f13 within a sample
    keep = ('stamp', 'cv', 'x1')
    day = record(kind, load(HOURS, 1), 1)
    found = identify([FaultFree('day', {name: day[name] for name in keep})], SHEET)
    assert any('not measured' in text for text in found.reasons)
    reference = Reference.read(found.learned, 'learned')
    settings = scada_settings(SHEET)

    def trace(*fault):
        columns = record(kind, load(AT + 600, 3), 3, *fault)
        columns = {
            name: columns[name] if name in keep else np.full(AT + 600, np.nan) for name in columns
        }
        columns['stamp'] = np.arange(AT + 600) * 1_000_000_000
        return ScadaMonitor(settings, reference).run(columns)

    assert not trace()['alarm'].any()
    for fault, strength in ((13, 0.25), (4, 1.0)):
        alarms = trace(fault, strength, AT)
        first = alarms['t'][alarms['alarm']]
        assert len(first)
        assert 0 <= first[0] - AT <= 60
