# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A twin: the constants of the simulated LuGre actuator that moves as the valve did."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.forces.breakaway import SHORT, breakaway
from damadics_fd.commands.commission.monitor import Proposal
from damadics_fd.commands.commission.signals import Signals, blocks, gather
from damadics_fd.commands.commission.twin.positioner import (
    ATMOSPHERE,
    ENOUGH,
    GAS,
    find_positioner,
    strokes,
)
from damadics_fd.commands.commission.valve_file import rows
from damadics_fd.core.approximator.transmitter import delay_column
from damadics_fd.core.record import Saved
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.document import differing
from damadics_fd.core.settings.identified import FaultFree
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.pneumatics import TRANSDUCER_INPUT, TRANSDUCER_OUTPUT

BRISTLE = 5e-6  # m by which the stem gives before it breaks away; with more, small slips slide
STRIBECK = 1e-3  # m/s
UNLIKE = 0.035  # of the air's movement: a positioner that leaves more is another one
ALIKE = 1.1  # times what a curve of its own leaves
UNKNOWN = 0.6  # and one of which nothing is known
HOLD = 0.005  # s; the delay of a curve of its own is in its lag
REACH = 12.0  # lags after which a step is over
TWIN, OPERATION = 'twin', 'operation'


def write_twin(proposal: Proposal, path: Path, actuator: str = '') -> None:
    """
    Write the file that `simulate --valve` and `plant` take.

    :param proposal: what commission found in mode monitor.
    :param path: of the file.
    :param actuator: tag of the valve.
    :raises CommissioningError: for a valve that the simulated actuator cannot be.
    :raises OSError: where the file cannot be written.
    """
    lines = [
        '# twin of a valve, written by commission: run it with',
        '#   ros2 run damadics_plant simulate nominal --valve FILE --out run.mcap',
        *rows(model(proposal, actuator) | {'settings': differing(proposal.settings)}, ''),
    ]
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')


def model(proposal: Proposal, actuator: str = '') -> Saved:
    """
    Return what the plant takes of a twin, by the parts of its file.

    :param proposal: what commission found in mode monitor.
    :param actuator: tag of the valve.
    :return: constants of the actuator, and at what pressures it worked.
    :raises CommissioningError: for a valve that the simulated actuator cannot be.
    """
    constants: Saved = {'actuator': actuator, 'sample_rate': proposal.settings.sample_rate}
    constants.update(twin(proposal))
    pressures: Saved = {}
    pressures.update(operation(proposal))
    return {TWIN: constants, OPERATION: pressures}


def twin(proposal: Proposal) -> Saved:
    """
    Return the constants of the simulated actuator.

    :param proposal: what commission found in mode monitor.
    :return: by the names of `damadics_plant.actuator.TwinActuator`, SI units, plug_diameter in mm.
    :raises CommissioningError: where the chamber is never filled or never vented.
    """
    s, b = proposal.settings, proposal.balance
    signals = gather([FaultFree('all', proposal.columns)])
    static = max(breakaway(signals, s, b.friction).force, b.friction)
    dry = max(b.friction, 1e-3 * s.stiffness * s.stroke)
    return {
        'stroke': s.stroke,
        'mass': s.mass,
        'stiffness': s.stiffness,
        'preload': s.preload * s.stroke,
        'viscous': b.viscous,
        'area': s.area,
        'dead_volume': s.chamber_volume,
        'gravity': s.gravity,
        'supply': s.supply_pressure,
        'air_opens': float(s.air_to == 'open'),
        'flow_closes': float(s.flow_to == 'close'),
        'plug_diameter': 1e3 * s.plug_diameter,
        'recovery': list(s.plug_table),
        'coulomb': dry,
        'static': max(static, 1.01 * dry),
        'stribeck': STRIBECK,
        'bristle_stiffness': max(static, dry) / BRISTLE,
        'bristle_damping': 2.0 * float(np.sqrt(s.mass * max(static, dry) / BRISTLE)),
        **positioner(signals, s),
    }


def positioner(signals: Signals, s: Settings) -> Saved:
    """
    Return the constants of the positioner and of the air.

    :param signals: the samples.
    :param s: settings with what commission found.
    :return: those of the benchmark's where it works like this, else a curve of its own.
    :raises CommissioningError: where the chamber is never filled or never vented.
    """
    air = air_path(signals, s) if s.air_to == 'close' else None
    own = find_positioner(signals, s)
    if air is not None and air.left < ALIKE * own.left:
        return {'lag': air.lag, 'air_flow': air.flow}
    if own.left > UNKNOWN:
        raise CommissioningError(
            'no twin: what goes into the chamber does not follow from command and position, '
            f'{100.0 * own.left:.0f} % of it is left'
        )
    return {
        'lag': own.lag,
        'hold': HOLD,
        'air_flow': own.flow,
        'errors': [float(f'{v:.4g}') for v in own.errors],
        'openings': [float(f'{v:.4g}') for v in own.openings],
        'reset_rate': own.reset_rate,
        'reset_band': own.reset_band,
        'fill_slope': own.fill_slope,
        'vent_slope': own.vent_slope,
    }


def operation(proposal: Proposal) -> dict[str, float]:
    """
    Return the pressures that the valve worked at, and the noise of its sensors.

    :param proposal: what commission found.
    :return: mean and swing (1.41 standard deviations) of P1 and P2 [Pa], and the standard
        deviation of the noise of each signal: what its third differences show.
    """
    found: dict[str, float] = {}
    for name in ('p1', 'p2', 'x1', 'ps'):
        column = np.asarray(proposal.columns[name], float)
        column = column[np.isfinite(column)]
        thirds = np.abs(np.diff(column, 3))
        noise = 1.4826 * float(np.median(thirds)) / np.sqrt(20.0)
        if name.startswith('p') and name != 'ps':
            swing = float(np.sqrt(max(2.0 * (float(np.var(column)) - noise**2), 0.0)))
            found |= {name: float(np.mean(column)), f'{name}_swing': swing}
        found[f'{name}_noise'] = noise
    return {name: float(f'{value:.4g}') for name, value in found.items()}


class AirPath(NamedTuple):
    """What stands between command and chamber."""

    lag: float  # each of the two of the set-point filter [s]
    flow: float  # factor at full opening [kg/(s sqrt(Pa))]
    left: float  # of the air's movement in strokes: the share that is not explained


def air_path(signals: Signals, s: Settings) -> AirPath | None:
    """
    Fit lag and flow factor of the simulated positioner to the air that went into the chamber.

    With the recorded command, position and pressure, every lag foretells the flow but for its
    factor; the lag is taken that leaves least.

    :param signals: the samples.
    :param s: settings with supply_pressure, chamber_volume, area, stroke.
    :return: None where another positioner works there.
    """
    if s.ps_lag > 0.0:  # the command as late as all else
        dt = np.diff(signals.t, prepend=-np.inf)
        signals = replace(signals, cv=delay_column(signals.cv, dt, s.ps_lag))
    b = blocks(signals, SHORT, s.ps_lag)
    k = np.arange(b.index[0], b.index[-1] + 1)
    cv, x, ps = (np.interp(k, b.index, column) for column in (b.cv, b.x, b.ps))
    air = (ATMOSPHERE + ps) * (s.chamber_volume + s.area * s.stroke * x) / GAS
    near = np.isin(k[:-1], b.index) & np.isin(k[1:], b.index)
    told = near & strokes(cv, x)
    if np.sum(told) >= ENOUGH:
        near = told
    put = np.diff(air)[near]
    valve = Valve()
    angle = 0.5 + np.arcsin(np.clip(x - 0.5, -1.0, 1.0)) * (180.0 / np.pi) / 60.0
    held = 0.5 * valve.positioner_period / SHORT  # how late its samples are, in blocks

    def fit(lag: float) -> tuple[float, float]:
        reach = np.arange(round(REACH * lag / SHORT) + 1) * SHORT
        kernel = (1.0 + reach / lag) * np.exp(-reach / lag)  # what is still missing of a step
        kernel = -np.diff(kernel, append=0.0)
        start = np.full(len(kernel) - 1, cv[0])
        set_point = np.convolve(np.concatenate([start, cv]), kernel, 'valid')
        error = np.clip(valve.positioner_gain * (set_point - angle), -1.0, 1.0)
        opening = np.interp(error, TRANSDUCER_INPUT, TRANSDUCER_OUTPUT)
        opening[1:] = (1.0 - held) * opening[1:] + held * opening[:-1]
        drop = np.where(opening > 0.0, s.supply_pressure - ps, ps)
        rate = opening * np.sqrt(np.maximum(drop, 0.0)) * SHORT
        rate = (0.5 * (rate[1:] + rate[:-1]))[near]
        factor = float(rate @ put) / max(float(rate @ rate), 1e-300)
        return float(np.sum((put - factor * rate) ** 2) / max(put @ put, 1e-300)), factor

    lags = np.geomspace(0.02, 5.0, 30)
    best = int(np.argmin([fit(lag)[0] for lag in lags]))
    around = np.linspace(lags[max(best - 1, 0)], lags[min(best + 1, len(lags) - 1)], 41)
    lag = float(min(around, key=lambda lag: fit(lag)[0]))
    left, flow = fit(lag)
    if flow <= 0.0 or left > UNLIKE:
        return None
    return AirPath(lag, flow, left)
