# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commissioning: settings for another valve, refusal of wrong units and directions (IN-7)."""

import re

import numpy as np
import pytest
import yaml
from damadics_fd.bag import BagWriter
from damadics_fd.commands.commission.command import main
from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.limit import _gumbel, _level
from damadics_fd.commands.commission.monitor import identify
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import FaultFree
from damadics_fd.store.fleet_file import read_fleet
from damadics_fd.store.references import load_reference

from ..bag.block_support import write_blocks
from ..core.synthetic import KL, valve

SHEET = Settings.for_mode('monitor', signature=False, own_alarm=False)


def propose(columns, sheet=SHEET, given=()):
    return identify([FaultFree('valve', columns)], sheet, given)


@pytest.fixture(scope='module')
def recording():
    return valve(400.0, stiffness=1.25, friction=0.02, noise=2e-4)


@pytest.fixture(scope='module')
def proposal(recording):
    return propose(recording)


def test_force_balance_of_another_valve(proposal):
    balance, s = proposal.balance, proposal.settings
    assert s.stiffness == pytest.approx(1.25 * 60892.0, rel=0.005)
    assert s.preload == pytest.approx(0.25, abs=0.01)
    # at one speed dry and viscous friction are one
    assert balance.total == pytest.approx((0.02 + 750.0 / 30446.0 * 0.12) * KL, rel=0.05)
    assert abs(balance.friction - 0.02 * KL) < 2.0 * balance.friction_std
    assert s.alpha5 == s.alpha4 == pytest.approx(1.25 * 30446.0, rel=0.005)
    assert s.dz >= 2.0 * s.delta
    assert s.rho_min > s.dz
    assert s.sample_rate == 200.0


def test_proposed_settings_watch_the_valve_without_alarm(proposal, recording):
    assert proposal.result.detections == []
    assert proposal.result.estimator.monitoring
    limit = proposal.limit
    assert limit.blocks == pytest.approx(34, abs=1)
    assert limit.seen <= limit.ratio
    assert limit.low <= limit.ratio <= limit.high
    assert 'extrapolation by a factor of 7' in limit.statement()


@pytest.mark.parametrize(('stated', 'told'), [(1.0, True), (1.2, False)])
def test_a_spring_that_is_not_the_stated_one_is_never_ok(recording, stated, told):
    sheet = SHEET.replace(stiffness=stated * 60892.0)
    found = propose(recording, sheet, {'stiffness'})
    reasons = [r for r in found.limiting if '1.25 times as stiff as stated' in r]
    assert bool(reasons) == told
    assert found.verdict != 'ok' or not told
    assert not any('as stiff as stated' in r for r in propose(recording, sheet).limiting)


@pytest.mark.parametrize('name', ['stroke', 'area'])
@pytest.mark.parametrize('share', [0.7, 1.3])
def test_what_no_recording_can_check_of_the_sheet_is_never_ok(recording, name, share):
    stated, spring = {'stroke', 'area'}, 1.25 * 60892.0
    wrong = SHEET.replace(**{name: share * getattr(SHEET, name)})
    found = propose(recording, wrong, stated)
    assert found.verdict != 'ok'
    assert any('the data sheet alone tells' in r for r in found.limiting), found.limiting
    found = propose(recording, wrong.replace(stiffness=spring), stated | {'stiffness'})
    assert found.verdict != 'ok'
    assert any('times as stiff as stated' in r for r in found.limiting), found.limiting


def test_a_sheet_with_the_right_spring_needs_no_word(recording):
    right = SHEET.replace(stiffness=1.25 * 60892.0)
    found = propose(recording, right, {'stroke', 'area', 'stiffness'})
    told = found.limiting + found.remarks
    assert not any('as stated' in r or 'sheet alone' in r for r in told), told


def test_constants_that_nobody_stated_are_those_of_the_default_valve_or_limited(recording):
    found = propose(recording)
    assert any('that of the default valve' in r for r in found.limiting), found.limiting
    own = propose(valve(200.0, friction=0.0108))
    assert not any('stiff' in r for r in own.limiting + own.remarks), own.limiting


def test_nominal_valve_gets_about_the_specified_constants():
    s = propose(valve(200.0, friction=0.0108)).settings
    assert s.delta == pytest.approx(0.03, rel=0.4)
    assert s.dz == pytest.approx(0.06, rel=0.4)
    assert s.gw == pytest.approx(500.0, rel=0.3)
    assert s.g5 == pytest.approx(1000.0, rel=0.3)
    assert s.rho_min == pytest.approx(0.2, rel=0.4)


def test_limit_of_a_known_distribution():
    rng = np.random.default_rng(0)
    location, scale = _gumbel(rng.gumbel(0.5, 0.1, 20000))
    assert (location, scale) == (pytest.approx(0.5, abs=0.01), pytest.approx(0.1, rel=0.03))
    hits = np.mean(rng.gumbel(0.5, 0.1, 200000) > _level(location, scale, 1000.0))
    assert hits == pytest.approx(1e-3, rel=0.4)


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda c: c.update(x1=100 * c['x1']), 'x1 reaches .* percent'),
        (lambda c: c.update(cv=100 * c['cv']), 'cv reaches .* percent'),
        (lambda c: c.update(p1=1e-6 * c['p1'], p2=1e-6 * c['p2']), 'p1 .* MPa.*p2 .* MPa'),
        (lambda c: c.update(ps=1e-5 * c['ps']), 'ps reaches only .* bar'),
        (lambda c: c.pop('ps'), 'ps is not measured'),
        (lambda c: c.update(cv=1 - c['cv']), 'x1 moves away from cv'),
        (lambda c: c.update(x1=0.5 + 0.1 * (c['x1'] - 0.5)), 'moves only'),
    ],
)
def test_wrong_units_and_directions_are_refused(recording, change, reason):
    columns = dict(recording)
    change(columns)
    with pytest.raises(CommissioningError, match=reason):
        propose(columns)


def test_command_writes_settings_plot_and_reference(tmp_path, recording, capsys):
    names = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
    table = np.column_stack([recording['stamp'] * 1e-9] + [recording[n] for n in names])
    file = tmp_path / 'valve.csv'
    np.savetxt(file, table, delimiter=',', header='t,' + ','.join(names), comments='', fmt='%.12g')
    out, plot = tmp_path / 'lv101.yaml', tmp_path / 'lv101.png'
    assert (
        main(
            [
                str(file),
                '--out',
                str(out),
                '--plot',
                str(plot),
                '--reference',
                str(tmp_path / 'LV-101'),
                '--actuator',
                'LV-101',
                '--days',
                '7',
            ]
        )
        == 0
    )
    text = capsys.readouterr().out
    assert 'K = 7' in text
    assert 'once in 7 days' in text
    content = yaml.safe_load(out.read_text())
    assert content['/**/estimator']['ros__parameters'] == {'reference': str(tmp_path / 'LV-101')}
    parameters = content['/**']['ros__parameters']
    assert parameters.pop('actuator') == 'LV-101'
    default = Settings.for_mode('monitor').to_dict()
    same = {n: v for n, v in parameters.items() if v == default[n]}
    assert same == {'mode': 'monitor'}
    settings = Settings.from_mapping(parameters)
    assert settings.stiffness == pytest.approx(76115.0, rel=0.005)
    reference = load_reference(tmp_path / 'LV-101', 'LV-101', settings)
    assert reference.source == str(file)
    assert plot.read_bytes().startswith(b'\x89PNG')


def test_command_refuses_in_one_line(tmp_path, capsys):
    assert main([str(tmp_path / 'none.csv')]) == 1
    error = capsys.readouterr().err
    assert error.startswith('commission: ')
    assert error.count('\n') == 1
    assert main([str(tmp_path), '--set', 'mass=-1']) == 1
    assert 'mass' in capsys.readouterr().err


def stated(columns, air_to):
    return identify([FaultFree('valve', columns)], SHEET.replace(air_to=air_to), {'air_to'})


def test_a_statement_that_the_pressure_contradicts_is_refused(recording):
    with pytest.raises(CommissioningError, match='x1 is inverted'):
        stated(recording, 'open')


def test_the_flow_tells_which_signal_is_inverted(recording):
    flow = 10.0 * (1.0 - recording['x1'])
    with pytest.raises(CommissioningError, match='x1 is inverted, as the flow shows'):
        propose({**recording, 'x1': 1.0 - recording['x1'], 'flow': flow})
    with pytest.raises(CommissioningError, match='cv is inverted, as the flow shows'):
        propose({**recording, 'cv': 1.0 - recording['cv'], 'flow': flow})


def test_command_and_position_a_quarter_period_apart_are_not_inverted(recording):
    late = dict(recording)
    turn = 500  # 2.5 s of a period of 10 s
    late['cv'] = np.roll(np.where(np.gradient(recording['x1']) > 0.0, 1.0, 0.0), 0)
    assert abs(np.corrcoef(late['cv'][turn:-turn], late['x1'][turn:-turn])[0, 1]) < 0.1
    assert propose(late).settings.stiffness == pytest.approx(1.25 * 60892.0, rel=0.005)


def test_an_actuator_without_spring_is_refused_as_such(recording):
    free = dict(recording)
    v = np.gradient(free['x1'])
    free['ps'] = 2e5 + 3e3 * np.sign(v) + 50.0 * np.random.default_rng(0).standard_normal(len(v))
    free['p1'] = free['p2']
    with pytest.raises(CommissioningError, match='without spring'):
        propose(free)


def test_two_valves_and_two_rates_are_refused_with_which(recording):
    other = valve(400.0, stiffness=0.9, friction=0.02, noise=2e-4)
    both = [FaultFree('a', recording), FaultFree('b', recording), FaultFree('c', other)]
    with pytest.raises(CommissioningError, match=r'not recordings of one valve.*: c \(K = 5'):
        identify(both, SHEET)
    slow = {name: column[::2] for name, column in recording.items()}
    both = [FaultFree('a', recording), FaultFree('b', recording), FaultFree('slow', slow)]
    with pytest.raises(CommissioningError, match='slow has 100 Hz'):
        identify(both, SHEET)


def test_constants_in_place_of_pressures_are_named(recording):
    typed = {**recording, 'p1': np.full(len(recording['p1']), 3.5e6)}
    typed['p2'] = np.full(len(typed['p1']), 2.6e6)
    proposal = propose(typed)
    assert proposal.verdict != 'ok'
    reasons = ' '.join((*proposal.refusing, *proposal.limiting))
    assert 'p1 is the constant 3.5e+06 Pa' in reasons
    assert 'will be missed' in reasons


def test_mode_scada_says_what_it_needs(tmp_path, capsys):
    file = tmp_path / 'short.csv'
    t = np.arange(600.0)
    table = np.column_stack([t, 0.5 + 0.3 * np.sin(0.01 * t), 0.5 + 0.3 * np.sin(0.01 * t - 0.1)])
    np.savetxt(file, table, delimiter=',', header='t,cv,x1', comments='')
    assert main([str(file), '--mode', 'scada']) == 1
    assert '600 s were recorded, 1800 s are needed' in capsys.readouterr().err.replace(
        '599', '600'
    )


def test_options_that_do_not_fit_are_refused(tmp_path, capsys):
    for words, reason in (
        (['a.csv', '--mode', 'scada', '--twin', 'b.yaml'], 'mode monitor'),
        (['a.csv', '--reference', 'r'], '--actuator'),
        (['a.csv', '--until', '0'], '--until'),
    ):
        with pytest.raises(SystemExit) as stop:
            main(words)
        assert stop.value.code == 2
        assert reason in capsys.readouterr().err


@pytest.fixture
def plant_bags(tmp_path, recording):
    """Two good valves in blocks, one that never moves with a topic of its own."""
    pytest.importorskip('damadics_msgs.msg')
    other = valve(400.0, stiffness=1.1, friction=0.03, noise=2e-4)
    still = {name: np.full(4000, column[0]) for name, column in recording.items()}
    still['stamp'] = recording['stamp'][:4000]
    write_blocks(tmp_path / 'bags' / 'blocks.mcap', {'/u1/lv1': recording, '/u1/lv2': other})
    with BagWriter(tmp_path / 'bags' / 'single.mcap') as bag:
        bag.add_topic('/lv3/measurement', 'damadics_msgs/msg/Measurement')
        stamp = still.pop('stamp')
        bag.write_columns(stamp, {'/lv3/measurement': still}, 'LV-103')
    return tmp_path / 'bags'


def test_a_folder_of_many_valves_gives_a_file_for_each_and_their_list(
    plant_bags, tmp_path, recording, proposal, capsys
):
    words = ['--out', str(tmp_path / 'valves'), '--reference', str(tmp_path / 'references')]
    assert main([str(plant_bags), *words]) == 1
    said = capsys.readouterr().out
    assert re.search(r'u1/lv1 \(U1/LV1\): (ok|limited)', said)
    assert 'lv3 (LV-103): failed: ' in said
    fleet = read_fleet(tmp_path / 'valves' / 'fleet.yaml')
    assert [one.name for one in fleet] == ['u1/lv1', 'u1/lv2']
    found = yaml.safe_load(fleet[0].parameters.read_text())['/**']['ros__parameters']
    assert found['actuator'] == 'U1/LV1'
    assert found['stiffness'] == pytest.approx(proposal.settings.stiffness, rel=1e-12)
    assert len(list((tmp_path / 'references').iterdir())) == 2


def test_many_valves_are_not_taken_for_one(plant_bags, tmp_path, capsys):
    assert main([str(plant_bags), '--out', str(tmp_path / 'a.yaml')]) == 1
    said = capsys.readouterr().err
    assert 'of 3 valves (u1/lv1, u1/lv2, lv3)' in said and '--topic' in said
    assert main([str(plant_bags), '--out', str(tmp_path / 'a'), '--actuator', 'LV-1']) == 1
    assert 'leave out --actuator' in capsys.readouterr().err
    words = ['--topic', '/u1/lv2', '--until', '0.5']
    assert main([str(plant_bags / 'blocks.mcap'), *words]) == 1
    assert 'valves' not in capsys.readouterr().err
