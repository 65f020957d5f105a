# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
An independent plant: the pneumatic valve of NASA's progpy, through the commissioning command.

It is run with spring return (the upper chamber vented) and its orifices throttled, so that a
stroke takes seconds, with the noise of good transmitters. Its geometry is its own.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml
from damadics_fd.bag import write_columns
from damadics_fd.commands.commission.command import main as commission
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.signature import SignatureView

from ..bag.bag_support import needs_messages

valve = pytest.importorskip(
    'progpy.models.pneumatic_valve', reason='progpy is not installed: pip install progpy'
)
pytestmark = needs_messages
RATE = 200.0  # Hz
FLUID = {'pL': 3.5e5, 'pR': 2.0e5}  # Pa, before and behind the plug
ORIFICE = 3e-7  # m2; 1e-5 of the model's defaults slams the valve within 0.3 s
PERIOD = 60.0  # s, half of it filling
FAULT = 240.0  # s


def record(seconds: float, fault: str = '', factor: float = 1.0) -> dict[str, np.ndarray]:
    """Simulate strokes of the valve; from FAULT on a state of wear has another value."""
    model = valve.PneumaticValveBase(process_noise=0, measurement_noise=0, At=ORIFICE, Ab=ORIFICE)
    p = model.parameters
    x = {**p['x0'], 'Aeb': 1e-9, 'Aet': 1e-9, 'pDiff': FLUID['pL'] - FLUID['pR']}
    x['mTop'] *= p['pAtm'] / p['pSupply']
    n = round(seconds * RATE)
    cv = (np.arange(n) / RATE % PERIOD < PERIOD / 2).astype(float)
    states = np.zeros((n, 3))
    for i in range(n):
        if fault and i == round(FAULT * RATE):
            x[fault] *= factor
        state = model.next_state(x, {**FLUID, 'uBot': cv[i], 'uTop': 0}, 1.0 / RATE)
        x = {name: float(np.ravel(state[name])[0]) for name in x}
        states[i] = x['x'], x['mBot'], x['mTop']
    position, bottom, top = states.T
    gas = p['R'] * p['gas_temp'] / p['gas_mass']
    ps = gas * (
        bottom / (p['Vbot0'] + p['Ap'] * position)
        - top / (p['Vtop0'] + p['Ap'] * (p['Ls'] - position))
    )
    rng = np.random.default_rng(1)
    return {
        'stamp': np.arange(1, n + 1) * round(1e9 / RATE),
        'cv': cv,
        'x1': position / p['Ls'] + 5e-4 * rng.standard_normal(n),
        'ps': ps + 200.0 * rng.standard_normal(n),
        'p1': np.full(n, FLUID['pL']),
        'p2': np.full(n, FLUID['pR']),
        't1': np.full(n, 20.0),
        'flow': np.full(n, 5.0),
    }


@pytest.fixture(scope='module')
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    """Return what the commissioning command proposes from a recording and the data sheet."""
    folder: Path = tmp_path_factory.mktemp('progpy')
    write_columns(folder / 'healthy.mcap', record(420.0))
    p = valve.PneumaticValveBase().parameters
    sheet = {
        'mass': p['m'],
        'stroke': p['Ls'],
        'area': p['Ap'],
        'gravity': -p['g'],
        'plug_diameter': float(np.sqrt(4.0 * p['Av'] / np.pi)),
        'plug_table': [1.0] * 12,
        'preload': 6.7,
        'stiffness': 50e3,
        'alpha1': 150.0,
        'alpha4': 1000.0,
        'alpha5': 1000.0,
        'ps_max': 6_000_000.0,
    }
    given = [word for item in sheet.items() for word in ('--set', '{}={}'.format(*item))]
    out = folder / 'valve.yaml'
    assert commission([str(folder / 'healthy.mcap'), '--out', str(out), *given]) == 0
    (node,) = yaml.safe_load(out.read_text()).values()
    return Settings.from_mapping(node['ros__parameters'])


def judged(settings: Settings, fault: str, factor: float) -> SignatureView:
    return run(record(540.0, fault, factor), settings).detector.signature.view()


def test_the_commissioning_command_finds_the_valve_of_progpy(settings):
    x0 = valve.PneumaticValveBase().parameters['x0']
    assert settings.stiffness == pytest.approx(x0['k'], rel=2e-3)
    assert settings.preload == pytest.approx(0.254 / 0.0381, rel=2e-3)
    assert settings.alpha1 * settings.mass == pytest.approx(x0['r'], rel=0.2)


@pytest.mark.parametrize(
    'fault, factor, cause, value',
    [('k', 0.97, 'spring_softer', -0.03), ('r', 3.0, 'friction_up', 2.0), ('', 1.0, 'none', None)],
)
def test_spring_and_friction_failures_of_progpy_are_told_apart(
    settings, fault, factor, cause, value
):
    view = judged(settings, fault, factor)
    assert view.cause == cause
    if value is not None:
        assert view.value == pytest.approx(value, rel=0.2)
