# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A twin: the constants of the simulated LuGre actuator that moves as the valve did."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.lag import plug_per_pascal
from damadics_fd.commands.commission.monitor import Proposal
from damadics_fd.commands.commission.signals import Blocks, Signals, blocks, gather
from damadics_fd.commands.commission.valve_file import rows
from damadics_fd.core.approximator.transmitter import delay_column
from damadics_fd.core.record import Floats, Saved
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.document import differing
from damadics_fd.core.settings.identified import FaultFree
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.pneumatics import TRANSDUCER_INPUT, TRANSDUCER_OUTPUT

ATMOSPHERE, GAS = 101325.0, 287.0 * 293.0  # Pa; R T of air [J/kg]
FINE, SHORT = 0.2, 0.05  # s
TOP = 90.0  # percentile of the flow that counts as full opening
TINY = 0.025  # s; means of the chamber pressure in which its answer to a step is sought
ANSWER, DEAD = 0.25, 0.02  # time constants, and s, until the air answers
LEAST_DRIVE = 3e4  # Pa
BRISTLE = 2e-5  # m by which the stem gives before it breaks away
STRIBECK = 1e-3  # m/s
UNLIKE = 0.035  # of the air's movement: a positioner that leaves more is another one
AWAY = 4.0  # deviations of the noise by which a stem has left its place
HUNTING = 0.03  # of the stroke, about the set-point
ENOUGH = 200  # blocks after steps of the command, that are judged alone
REACH = 12.0  # lags after which a step is over
VENTING = 0.55  # of the booster's opening, at most, where it vents
STEP = 0.05  # of the stroke; smaller steps of the command do not count
LOOK = 3.0  # s after a step
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


def twin(proposal: Proposal) -> dict[str, float]:
    """
    Return the constants of the simulated actuator.

    :param proposal: what commission found in mode monitor.
    :return: by the names of `damadics_plant.LuGreActuator`, SI units, plug_diameter in mm.
    :raises CommissioningError: for a valve that the simulated actuator cannot be.
    """
    s, b = proposal.settings, proposal.balance
    if s.air_to != 'close' or s.flow_to != 'open':
        raise CommissioningError(
            'no twin: the simulated actuator is closed by air and opened by the flow, this valve '
            f'has air to {s.air_to}, flow to {s.flow_to}'
        )
    signals = gather([FaultFree('all', proposal.columns)])
    fine = blocks(signals, FINE, s.ps_lag)
    static = max(breakaway(signals, s), b.friction)
    air = air_path(signals, s)
    if air is None:
        fill, vent = capacities(fine, s)
        air = AirPath(response(signals), max(fill, vent / VENTING))
    dry = max(b.friction, 1e-3 * s.stiffness * s.stroke)
    gain = b.gain if s.plug_diameter > 0.0 else 0.0
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
        'air_flow': air.flow,
        'lag': air.lag,
        'plug_diameter': 1e3 * proposal.sheet_diameter * float(np.sqrt(gain)),
        'coulomb': dry,
        'static': max(static, 1.01 * dry),
        'stribeck': STRIBECK,
        'bristle_stiffness': max(static, dry) / BRISTLE,
        'bristle_damping': 2.0 * float(np.sqrt(s.mass * max(static, dry) / BRISTLE)),
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


def breakaway(signals: Signals, s: Settings) -> float:
    """
    Return the friction that the stem overcomes when it begins to move.

    While it stands the force rises by itself; a line through the last tenth of a second tells
    what it was when the stem left its place.

    :param signals: the samples.
    :param s: settings with what commission found.
    :return: [N], the median over the strokes; 0 where none began in mid-stroke.
    """
    b = blocks(signals, SHORT, s.ps_lag)
    x, dp = signals.x, signals.dp
    if s.ps_lag > 0.0:
        dt = np.diff(signals.t, prepend=-np.inf)
        x, dp = delay_column(x, dt, s.ps_lag), delay_column(dp, dt, s.ps_lag)
    noise = 1.4826 * float(np.median(np.abs(np.diff(x, 3)))) / np.sqrt(20.0)
    borne = []
    whole = b.index[2:] - b.index[:-2] == 2
    for k in np.flatnonzero(b.standing[:-2] & b.moving[2:] & whole):
        first, last = np.searchsorted(signals.t, b.t[k] + np.array([-1.5, 2.5]) * SHORT)
        t, xs = signals.t[first:last], x[first:last]
        still = t < b.t[k]
        if np.ptp(t) > 5.0 * SHORT or still.sum() < 4:
            continue
        place, way = float(np.mean(xs[still])), float(np.sign(b.v[k + 2]))
        away = (xs - place) * way > AWAY * noise
        left = int(np.argmax(away & np.roll(away, -1)))
        before = (t < t[left] - 0.1 * SHORT) & (t >= t[left] - 2.0 * SHORT)
        if left == 0 or before.sum() < 4:
            continue
        plug = float(plug_per_pascal(s, np.array([place]))[0]) * dp[first:last]
        force = s.mass * s.gravity + s.signed_area * signals.ps[first:last]
        force -= (plug if s.flow_to == 'open' else -plug) + s.stiffness * s.stroke * (
            place + s.spring_origin
        )
        line = np.polyfit(t[before] - t[left], force[before], 1)
        borne.append(float(line[1]) * way)
    return max(float(np.median(borne)), 0.0) if borne else 0.0


class AirPath(NamedTuple):
    """What stands between command and chamber."""

    lag: float  # each of the two of the set-point filter [s]
    flow: float  # factor at full opening [kg/(s sqrt(Pa))]


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
    # a stem that sticks hunts about its set-point, where noise decides: a stroke tells
    steps = np.abs(np.diff(cv)) > STEP
    stroke = np.convolve(steps, np.ones(round(LOOK / SHORT)))[: len(steps)] > 0.5
    stroke &= np.abs(cv - x)[1:] > HUNTING
    if np.sum(near & stroke) >= ENOUGH:
        near &= stroke
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
        return float(np.sum((put - factor * rate) ** 2)), factor

    lags = np.geomspace(0.02, 5.0, 30)
    best = int(np.argmin([fit(lag)[0] for lag in lags]))
    around = np.linspace(lags[max(best - 1, 0)], lags[min(best + 1, len(lags) - 1)], 41)
    lag = float(min(around, key=lambda lag: fit(lag)[0]))
    left, flow = fit(lag)
    if flow <= 0.0 or left > UNLIKE * float(put @ put):
        return None
    return AirPath(lag, flow)


def capacities(b: Blocks, s: Settings) -> tuple[float, float]:
    """
    Return the flow factors of filling and venting at full opening.

    :param b: blocks of the recording.
    :param s: settings with supply_pressure, chamber_volume, area, stroke.
    :return: [kg/(s sqrt(Pa))] each.
    :raises CommissioningError: where the chamber never fills or never vents.
    """
    air = (ATMOSPHERE + b.ps) * (s.chamber_volume + s.area * s.stroke * b.x) / GAS
    near = np.diff(b.index) == 1
    flow = np.diff(air)[near] / b.width
    ps = (0.5 * (b.ps[1:] + b.ps[:-1]))[near]

    def top(rate: Floats, drive: Floats) -> float:
        use = (rate > 0.0) & (drive > LEAST_DRIVE)
        if use.sum() < 10:
            raise CommissioningError('no twin: the chamber is never filled or never vented')
        return float(np.percentile(rate[use] / np.sqrt(drive[use]), TOP))

    return top(flow, s.supply_pressure - ps), top(-flow, ps)


def response(signals: Signals) -> float:
    """
    Return the time constant of the positioner's set-point filter, from when the air answers.

    The filter has two equal lags; the air answers when its output has gone 2 % of a step, after
    a quarter of a time constant. When it did is read from the pressure's rise, traced back.

    :param signals: the samples.
    :return: [s].
    """
    n = max(1, round(TINY * signals.rate))
    rows = len(signals.ps) // n
    ps = signals.ps[: rows * n].reshape(rows, n).mean(axis=1)
    cv = signals.cv[: rows * n].reshape(rows, n)[:, -1]
    width, waits = n / signals.rate, []
    still, look = round(1.0 / width), round(LOOK / width)
    for i in np.flatnonzero(np.abs(np.diff(cv)) > STEP)[:400]:
        before, after = ps[max(0, i - still) : i], ps[i : i + look]
        if len(before) < still or len(after) < look:
            continue
        noise = float(np.std(np.diff(before))) + 20.0
        rise = np.abs(after - before.mean())
        crossed = np.flatnonzero(rise > 8.0 * noise)
        if not len(crossed) or float(np.ptp(before)) > 8.0 * noise or crossed[0] + 4 >= look:
            continue
        k = int(crossed[0])
        slope = (rise[k + 4] - rise[k]) / (4.0 * width)
        if slope > 0.0:
            waits.append(max(k * width - rise[k] / slope, 0.0))
    if not waits:
        return 0.3
    return float(min(max((np.median(waits) - DEAD) / ANSWER, 0.02), 5.0))
