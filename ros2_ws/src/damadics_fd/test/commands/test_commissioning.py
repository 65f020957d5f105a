# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commissioning: settings for another valve, refusal of wrong units and directions (IN-7)."""

import numpy as np
import pytest
import yaml
from damadics_fd.commands.commission import main
from damadics_fd.commands.commissioning import CommissioningError, _gumbel, _level, propose
from damadics_fd.core.settings import Settings
from damadics_fd.store.references import load_reference

from ..core.synthetic import KL, valve

SHEET = Settings.for_mode('monitor', signature=False, own_alarm=False)


@pytest.fixture(scope='module')
def recording():
    return valve(400.0, stiffness=1.25, friction=0.02, noise=2e-4)


@pytest.fixture(scope='module')
def proposal(recording):
    return propose(recording, SHEET)


def test_force_balance_of_another_valve(proposal):
    balance, s = proposal.balance, proposal.settings
    assert balance.stiffness == pytest.approx(1.25 * 60892.0, rel=0.005)
    assert balance.preload == pytest.approx(0.25, abs=0.01)
    assert balance.friction == pytest.approx(0.02 * KL, rel=0.1)
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


def test_nominal_valve_gets_about_the_specified_constants():
    s = propose(valve(200.0, friction=0.0108), SHEET).settings
    assert s.delta == pytest.approx(0.03, rel=0.3)
    assert s.dz == pytest.approx(0.06, rel=0.3)
    assert s.gw == pytest.approx(500.0, rel=0.3)
    assert s.g5 == pytest.approx(1000.0, rel=0.3)
    assert s.rho_min == pytest.approx(0.2, rel=0.3)


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
        (lambda c: c.update(cv=1 - c['cv']), 'x1 falls when cv rises'),
        (lambda c: c.update(x1=1 - c['x1'], cv=1 - c['cv']), 'x1 falls when ps rises'),
        (lambda c: c.update(x1=0.5 + 0.1 * (c['x1'] - 0.5)), 'moves only'),
    ],
)
def test_wrong_units_and_directions_are_refused(recording, change, reason):
    columns = dict(recording)
    change(columns)
    with pytest.raises(CommissioningError, match=reason):
        propose(columns, SHEET)


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
    parameters = yaml.safe_load(out.read_text())['/**']['ros__parameters']
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
