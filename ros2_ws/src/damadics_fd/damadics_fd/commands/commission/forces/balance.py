# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The force balance of the moving stem: spring, friction, and the plug force that no sheet knows.

air Ae Ps + m g = K L (X + origin) + c L v + (Fc + Fs e^-(v/vs)^2) sgn v + flow (1 + e(X)) Fvc
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.forces.lag import (
    SIGN_GAIN,
    WIDTH,
    Lag,
    Mask,
    find_lag,
    trust,
)
from damadics_fd.commands.commission.forces.regression import (
    ONE,
    TABLE,
    K,
    S,
    V,
    add_viscous_prior,
    blur_of,
    prior_of,
    regressor,
    solve,
)
from damadics_fd.commands.commission.signals import Blocks, Signals, blocks, steady
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.sliding import STICKING

BLOCK = 0.1  # s
SAME_LAG = 0.003  # s
NO_LAG = 0.9  # of the misfit with a lag: without it less is left, of other blocks though
STICKY_SHARE = 0.5  # of blocks that stick and slip, from which strokes tell no lag
STICKY_LAGS = (0.03, 0.05, 0.08, 0.13, 0.2)  # s
CLEARLY = 0.85  # of what is left without a lag: 0.91 and more where there is none
LEAST = 20  # moving blocks each way
MODEL_ERROR = 1e-3  # of the spring force over the stroke: the balance is no better than that
WIDE, NARROW = (0.5, 0.2), (0.05, 0.03)  # prior of the plug force: in common, per node
TABLE_X = np.r_[0.0:0.91:0.1, 0.99, 1.0]
LOWEST, HIGHEST = 0.01, 10.0  # entries of plug_table
NO_SPRING = 10.0  # strokes of preload that no spring has


@dataclass(frozen=True)
class Balance:
    """Hold the fit; forces in N, the axis of time that of the blocks used."""

    settings: Settings  # with stiffness, preload, directions, plug force and lag of the valve
    lag: Lag
    viscous: float  # c [N s/m]
    friction: float  # dry, Fc [N]
    stribeck: float  # how much more where the stem is slow or sticks and slips [N]
    covariance: Floats  # of K, b, c, Fc
    misfit: float  # standard deviation of the force left over [N]
    noise: float  # the part of it that sensors explain [N]
    gain: float  # plug force / that of the data sheet, mean over the stroke
    shape: float  # how far it departs from that
    plug: float  # mean plug force [N]; 0 where it was not told apart from the spring
    t: Floats
    x: Floats
    v: Floats
    sticky: Mask  # the stem sticks and slips within the block
    force: Floats  # without the plug force [N]
    fitted: Floats
    columns: Floats  # of K, b, c, Fc: shape (n, 4)
    watched: float  # s of good blocks, moving or not
    undetermined: tuple[str, ...]

    @property
    def stiffness_std(self) -> float:
        """Standard deviation of the stiffness [N/m]."""
        return float(np.sqrt(self.covariance[K, K]))

    @property
    def friction_std(self) -> float:
        """Standard deviation of the dry friction [N], the lag's part included."""
        return float(np.sqrt(self.covariance[S, S]))

    @property
    def viscous_std(self) -> float:
        """Standard deviation of the viscous friction [N s/m], the lag's part included."""
        lagged = self.settings.stiffness * self.lag.std
        return float(np.hypot(np.sqrt(self.covariance[V, V]), lagged))

    @property
    def total(self) -> float:
        """Dry and viscous friction at the usual speed [N]."""
        v = self.settings.stroke * float(np.median(np.abs(self.v)))
        return self.friction + self.viscous * v


def find_balance(
    signals: Signals, sheet: Settings, given: Collection[str] = (), pressures: bool = True
) -> Balance:
    """
    Identify directions, lag, plug force, spring and friction.

    :param signals: good samples of a fault-free valve.
    :param sheet: settings with what the data sheet says.
    :param given: names of the settings that the user stated.
    :param pressures: P1 and P2 are measured; constants in their place would pass for a lag.
    :return: the balance.
    :raises CommissioningError: where the stem moves too little, or the fit is no valve.
    """
    fine = blocks(signals, WIDTH)
    viscous = sheet.alpha1 * sheet.mass if 'alpha1' in given else None
    lag = find_lag(fine, sheet, viscous)
    s, undetermined = _directed(sheet, lag, given)
    if not pressures:
        lag = replace(lag, seconds=0.0)
    balance = _with_lag(signals, s, lag, sheet, given, undetermined)
    if not pressures:
        return balance
    again = find_lag(fine, balance.settings, viscous)  # a better plug force tells the lag better
    if abs(again.seconds - lag.seconds) >= SAME_LAG:
        lag = again
        balance = _with_lag(signals, s, lag, sheet, given, undetermined)
    if lag.seconds > 0.0:  # a lag that leaves clearly more than none was no lag
        without = replace(lag, seconds=0.0)
        none = _with_lag(signals, s, without, sheet, given, undetermined, lag.seconds)
        if none.misfit < NO_LAG * balance.misfit:
            lag, balance = without, _with_lag(signals, s, without, sheet, given, undetermined)
    if lag.seconds == 0.0 and float(np.mean(balance.sticky)) > STICKY_SHARE:
        return _lag_by_blocks(signals, s, balance, sheet, given, undetermined)
    return balance


def _lag_by_blocks(
    signals: Signals,
    s: Settings,
    none: Balance,
    sheet: Settings,
    given: Collection[str],
    undetermined: list[str],
) -> Balance:
    """Return the balance with the lag that leaves least, if that is clearly less than none."""

    def left(b: Balance) -> float:
        w = trust(b.v, b.sticky)
        return float(np.sqrt(np.sum(w * (b.force - b.fitted) ** 2) / np.sum(w)))

    found = {0.0: none}
    for T in STICKY_LAGS:
        lag = replace(none.lag, seconds=T, std=0.2 * T)
        found[T] = _with_lag(signals, s, lag, sheet, given, undetermined, STICKY_LAGS[-1])
    best = min(found, key=lambda T: left(found[T]))
    if best == 0.0 or left(found[best]) > CLEARLY * left(none):
        return none
    return _with_lag(signals, s, found[best].lag, sheet, given, undetermined)


def _with_lag(
    signals: Signals,
    s: Settings,
    lag: Lag,
    sheet: Settings,
    given: Collection[str],
    undetermined: list[str],
    carried: float = 0.0,
) -> Balance:
    s = s.replace(
        ps_lag=float(f'{lag.seconds:.3g}'),
        ps_lag_std=float(f'{lag.std:.2g}') if lag.std < 1.0 else 1.0,
    )
    b = blocks(signals, BLOCK, s.ps_lag, carried)
    use = _enough(b)
    s, gain, shape = _plug(b, use, s, sheet, given)
    return _final(b, use, s, lag, gain, shape, sheet, given, undetermined)


def _directed(sheet: Settings, lag: Lag, given: Collection[str]) -> tuple[Settings, list[str]]:
    undetermined = []
    air, flow = ('close' if lag.air > 0.0 else 'open'), ('open' if lag.flow > 0.0 else 'close')
    if lag.air_gain < SIGN_GAIN:
        undetermined.append('air_to')
        air = sheet.air_to
    elif 'air_to' in given and air != sheet.air_to:
        raise CommissioningError(
            f'the pressure works as if air_to were {air}, not {sheet.air_to} as stated: x1 is '
            'inverted (1 must mean closed), or air_to is stated wrongly'
        )
    if lag.flow_gain < SIGN_GAIN or 'flow_to' in given:
        if 'flow_to' not in given and sheet.plug_diameter > 0.0:
            undetermined.append('flow_to')
        flow = sheet.flow_to
    return sheet.replace(air_to=air, flow_to=flow), undetermined


def _enough(b: Blocks) -> Mask:
    use = b.moving
    up, down = int(np.sum(use & (b.v > 0.0))), int(np.sum(use & (b.v < 0.0)))
    if min(up, down) < LEAST:
        whole = len(b.t) * b.width
        raise CommissioningError(
            f'{up * BLOCK:.1f} s of steady closing and {down * BLOCK:.1f} s of opening in '
            f'mid-stroke among {whole:.0f} s of good data, {LEAST * BLOCK:g} s of each are '
            'needed: move it both ways'
        )
    return use


def _plug(
    b: Blocks, use: Mask, s: Settings, sheet: Settings, given: Collection[str]
) -> tuple[Settings, float, float]:
    """Fit the plug force table; return settings, gain and departure of the shape."""
    if s.plug_diameter <= 0.0:
        return s, 1.0, 0.0
    base = s.replace(plug_table=sheet.plug_table, plug_diameter=sheet.plug_diameter)
    rows, common, per_node = base, *WIDE
    if steady(b):
        common = NARROW[0]  # nothing tells it, and the spring would take what it is wrong by
    e_total = np.ones(11)
    for _ in range(3):
        force, columns, hats = regressor(b, rows)
        A = np.concatenate([columns, hats], axis=1)[use]
        precision, mean = prior_of(sheet, given, A.shape[1])
        table = np.full((11, 11), common**2) + np.eye(11) * per_node**2
        precision[TABLE:, TABLE:] = np.linalg.inv(table)
        add_viscous_prior(precision, mean, A, force[use], b.v[use], given)
        floor = MODEL_ERROR * s.stiffness * s.stroke
        fit = solve(
            A,
            force[use],
            precision,
            mean,
            floor,
            trust(b.v[use], b.sticky[use]),
            blur_of(b, use, s),
        )
        e_total = np.maximum(e_total * (1.0 + fit.theta[TABLE:]), 0.003)
        rows = _with_table(base, e_total)
        common, per_node = NARROW
    seen = np.histogram(b.x[use], np.linspace(-0.05, 1.05, 12))[0] > 0
    gain = float(np.mean(e_total[seen]))
    return rows, gain, float(np.std(e_total[seen] / gain))


def _with_table(base: Settings, e: Floats) -> Settings:
    factor = np.interp(TABLE_X, np.arange(11) / 10.0, e)
    table = np.asarray(base.plug_table) / factor
    shrink = max(1.0, float(table.max()) / (0.99 * HIGHEST))
    table = np.maximum(table / shrink, 1.01 * LOWEST)
    diameter = base.plug_diameter / float(np.sqrt(shrink))
    return base.replace(plug_table=tuple(float(f'{v:.4g}') for v in table), plug_diameter=diameter)


def _final(
    b: Blocks,
    use: Mask,
    s: Settings,
    lag: Lag,
    gain: float,
    shape: float,
    sheet: Settings,
    given: Collection[str],
    undetermined: list[str],
) -> Balance:
    force, columns, hats = regressor(b, s)
    A = columns[use]
    plugged = s.plug_diameter > 0.0
    if plugged:
        A = np.concatenate([columns, hats], axis=1)[use]
    precision, mean = prior_of(sheet, given, A.shape[1])
    if plugged:
        table = np.full((11, 11), 0.01**2) + np.eye(11) * 0.005**2
        precision[TABLE:, TABLE:] = np.linalg.inv(table)
    add_viscous_prior(precision, mean, A, force[use], b.v[use], given)
    floor = MODEL_ERROR * s.stiffness * s.stroke
    fit = solve(
        A,
        force[use],
        precision,
        mean,
        0.2 * floor,
        trust(b.v[use], b.sticky[use]),
        blur_of(b, use, s),
    )
    K_, offset, viscous, dry, slow = (float(v) for v in fit.theta[:5])
    origin = offset / (K_ * s.stroke) if K_ != 0.0 else np.inf
    preload = origin if s.air_to == 'close' else -1.0 - origin
    if K_ <= 0.0 or K_ * s.stroke < 2.0 * fit.sigma or preload > NO_SPRING:
        raise CommissioningError(
            f'no spring is seen (K = {K_:.3g} N/m, preload {preload:.3g} strokes): an actuator '
            'without spring return, double acting, is not supported; of a valve with a spring '
            'check area, stroke and the units of the pressures'
        )
    model = A[:, [K, ONE, V, S]]
    unseen = max(-viscous / K_, 0.0)  # nothing but a lag that was not found rubs less than nothing
    viscous = max(viscous, 0.0)
    settings = s.replace(
        stiffness=float(f'{K_:.5g}'),
        preload=float(f'{max(preload, 0.0):.4g}'),
        ps_lag_std=min(max(s.ps_lag_std, float(f'{unseen:.2g}')), 1.0),
    )
    sensors = float(np.std(np.diff(fit.left)[np.diff(b.index[use]) == 1])) / np.sqrt(2.0)
    names = list(undetermined)
    pushed = float(np.mean(np.abs(A[:, TABLE:].sum(axis=1)))) if plugged else 0.0
    if plugged and steady(b):
        names.append('plug force apart from the spring (P1 - P2 did not vary)')
        pushed = 0.0
    return Balance(
        settings,
        lag,
        viscous,
        abs(dry),
        max(slow + (STICKING * abs(dry) if np.any(b.sticky[use]) else 0.0), 0.0),
        fit.covariance[: S + 1, : S + 1],
        fit.sigma,
        sensors,
        gain,
        shape,
        pushed,
        b.t[use],
        b.x[use],
        b.v[use],
        b.sticky[use],
        force[use],
        force[use] - fit.left,
        model,
        len(b.t) * b.width,
        tuple(names),
    )
