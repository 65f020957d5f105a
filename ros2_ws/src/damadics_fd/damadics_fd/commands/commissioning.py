# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Propose the settings of monitor mode for an actuator from a fault-free recording of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.monitor import run
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings

DAY = 86400.0
BLOCK = 10.0  # s; windows whose largest ratio counts as one draw
LEAST_BLOCKS = 20
STEADY = 0.2  # s; means over it are used where it and its neighbours move in one direction
SLOWEST = 0.02  # strokes/s; slower motion tells sliding from sticking badly
MODEL_ERROR = 1e-3  # of the spring force over the stroke: the balance is no better than that
VISCOUS_STD = 0.3  # how well a data sheet's viscous friction is known, as a share
BANDWIDTHS = (50.0, 25.0)  # rad/s, tried from the fast one on until the noise is low enough


class CommissioningError(ValueError):
    """Tell why a recording cannot commission a valve, and what to do."""


@dataclass(frozen=True)
class Balance:
    """Hold the force balance m g + Ae Ps - Fvc = K L (x + x0) + s2 L v + Fc sign v."""

    stiffness: float  # K [N/m]
    preload: float  # x0 / stroke
    viscous: float  # s2 [N s/m]
    friction: float  # Fc [N]
    stiffness_std: float  # [N/m]
    misfit: float  # standard deviation of the force left over [N]
    x: NDArray[np.float64]  # position of the samples used
    force: NDArray[np.float64]  # their force [N]
    fitted: NDArray[np.float64]  # [N]


@dataclass(frozen=True)
class Limit:
    """Hold the limit on residual/threshold for a number of false alarms."""

    ratio: float  # limit for at most one false alarm in `days`
    low: float  # 90 % interval of that limit
    high: float
    days: float
    hours: float  # monitored time in the recording
    blocks: int
    seen: float  # largest ratio in the recording
    maxima: NDArray[np.float64]
    location: float  # of the Gumbel distribution of the maxima
    scale: float

    def statement(self) -> str:
        """
        Say what the limit rests on.

        :return: for people.
        """
        factor = self.days * 24.0 / self.hours
        return (
            f'{self.hours:.2f} h of fault-free monitoring, {self.blocks} windows of {BLOCK:g} s, '
            f'largest residual/threshold {self.seen:.2f}. A limit of {self.ratio:.2f} '
            f'(90 % interval {self.low:.2f}..{self.high:.2f}) is reached once in {self.days:g} '
            f'days if the largest values go on as a Gumbel distribution and the valve works as '
            f'it did in the recording: an extrapolation by a factor of {factor:.0f} in time. '
            f'Without that assumption the recording only shows that there are fewer than '
            f'{3.0 / self.hours:.2g} false alarms per hour (95 % confidence).'
        )


@dataclass(frozen=True)
class Proposal:
    """Hold proposed settings and what they rest on."""

    settings: Settings
    balance: Balance
    limit: Limit | None  # None where too little was monitored
    result: Result  # the recording with the proposed settings
    noise: float  # standard deviation of xi2 from sensor noise [1/s]
    remarks: list[str] = field(default_factory=list)


def propose(
    columns: Mapping[str, NDArray[Any]], data_sheet: Settings, days: float = 30.0
) -> Proposal:
    """
    Propose settings from a fault-free recording in which the valve moves both ways.

    :param columns: as for `core.monitor.run`.
    :param data_sheet: monitor settings with what the data sheet says: mass, stroke, area, plug.
    :param days: at most one false alarm in so many days.
    :return: the proposal.
    :raises CommissioningError: where units or directions are wrong or the recording shows too
        little.
    """
    check_units(columns)
    check_directions(columns)
    rate = sample_rate(columns['stamp'])
    base = data_sheet.replace(sample_rate=rate, signature=False, own_alarm=False)
    balance = fit_balance(run(columns, base.replace(t_learn=1e6)), columns, base)
    settings, noise, remarks = tune(columns, base, balance)
    result = run(columns, settings)
    limit = None
    if result.estimator.monitoring:
        limit = set_limit(result, settings, days)
    else:
        remarks.append(f'the recording does not finish learning: {result.estimator.status}')
    if limit is None:
        remarks.append('too little was monitored to propose a limit: record longer')
    elif limit.ratio > 1.0:
        step = limit.ratio / settings.level_maintenance
        settings = settings.replace(
            level_maintenance=limit.ratio,
            level_specification=settings.level_specification * step,
            level_failure=settings.level_failure * step,
        )
    settings = settings.replace(signature=data_sheet.signature, own_alarm=data_sheet.own_alarm)
    return Proposal(settings, balance, limit, result, noise, remarks)


def check_units(columns: Mapping[str, NDArray[Any]]) -> None:
    """
    Refuse percent for fractions and bar or MPa for Pa.

    :param columns: the recording.
    :raises CommissioningError: naming every signal that is off.
    """
    wrong = []
    for name in ('cv', 'x1', 'p1', 'p2', 'ps'):
        values = np.asarray(columns.get(name, ()), float)
        values = values[np.isfinite(values)]
        if not len(values):
            wrong.append(f'{name} is not measured')
            continue
        top = float(np.percentile(np.abs(values), 99.0))
        if name in ('cv', 'x1') and top > 1.5:
            wrong.append(
                f'{name} reaches {top:.3g}: percent? give a fraction: --map {name}=SOURCE*0.01'
            )
        if name in ('p1', 'p2', 'ps') and top < 2e3:
            unit = 'MPa' if top < 5.0 and name != 'ps' else 'bar or kPa'
            wrong.append(
                f'{name} reaches only {top:.3g}: {unit}? give Pa: --map {name}=SOURCE*FACTOR'
            )
    if wrong:
        raise CommissioningError('; '.join(wrong))


def check_directions(columns: Mapping[str, NDArray[Any]]) -> None:
    """
    Refuse an inverted control value, position or chamber pressure.

    :param columns: the recording.
    :raises CommissioningError: where x1 does not rise with cv or ps.
    """
    good = np.all([np.isfinite(columns[name]) for name in ('cv', 'x1', 'ps')], axis=0)
    cv, x1, ps = (np.asarray(columns[name], float)[good] for name in ('cv', 'x1', 'ps'))
    if len(x1) < 10 or np.ptp(x1) < 0.2:
        raise CommissioningError(
            f'the stem moves only {np.ptp(x1) if len(x1) else 0.0:.2f} of '
            'its stroke: move the valve through 0.2 or more, both ways'
        )
    lead = {
        name: float(np.corrcoef(signal, x1)[0, 1])
        for name, signal in (('cv', cv), ('ps', ps))
        if np.ptp(signal) > 0.0
    }
    if lead.get('cv', 1.0) < 0.0:
        raise CommissioningError(
            'x1 falls when cv rises: one of them is inverted; 1 must mean closed in both'
        )
    if lead.get('ps', 1.0) < 0.0:
        raise CommissioningError(
            'x1 falls when ps rises: this is a pressure-to-open valve or x1 '
            'is inverted; 1 must mean closed, and pressure must close'
        )


def sample_rate(stamps: NDArray[np.int64]) -> float:
    """
    Return the nominal sample rate.

    :param stamps: [ns].
    :return: [Hz], rounded to 4 digits.
    :raises CommissioningError: where there are no two samples in order.
    """
    steps = np.diff(np.asarray(stamps, np.int64))
    steps = steps[steps > 0]
    if not len(steps):
        raise CommissioningError('the stamps do not rise')
    return float(f'{1e9 / float(np.median(steps)):.4g}')


def fit_balance(result: Result, columns: Mapping[str, NDArray[Any]], base: Settings) -> Balance:
    """
    Fit the force balance to the moving stem by least squares.

    :param result: the recording through the estimator, for its velocity and force.
    :param columns: the recording.
    :param base: settings with the data sheet.
    :return: the fit.
    :raises CommissioningError: where the stem moves too little, or the fit is no valve.
    """
    e = result.estimates
    smooth = e['x1_hat'] + e['xi1'] - base.preload
    inside = result.accepted & (smooth > base.gate_low) & (smooth < 1.0 - base.gate_high)
    width = max(1, round(STEADY * base.sample_rate))
    x, v, force = (
        _means(signal, width)
        for signal in (
            np.asarray(columns['x1'], float),
            e['x2'],
            e['u'] * base.stiffness * base.stroke,
        )
    )
    steady = [
        np.convolve(way & (_means(inside, width) == 1.0), np.ones(3), 'same') > 2.5
        for way in (v > SLOWEST, v < -SLOWEST)
    ]  # and so before and after
    up, down = (int(np.sum(way)) for way in steady)
    if min(up, down) < LEAST_BLOCKS:
        raise CommissioningError(
            f'{up * STEADY:.1f} s of steady closing and {down * STEADY:.1f} s of opening in '
            f'mid-stroke, {LEAST_BLOCKS * STEADY:g} s of each are needed: move it both ways'
        )
    use = steady[0] | steady[1]
    x, v, force = x[use], v[use], force[use]
    A = np.column_stack([base.stroke * x, np.ones(len(x)), base.stroke * v, np.sign(v)])
    theta, *_ = np.linalg.lstsq(A, force, rcond=None)
    misfit = max(float(np.std(force - A @ theta)), MODEL_ERROR * base.stiffness * base.stroke)
    # a stem that always moves at one speed cannot tell dry from viscous friction: lean on the
    # data sheet's viscous friction, known to VISCOUS_STD
    sheet = max(base.alpha1 * base.mass, 1.0)
    H, g = A.T @ A / misfit**2, A.T @ force / misfit**2
    H[2, 2] += 1.0 / (VISCOUS_STD * sheet) ** 2
    g[2] += sheet / (VISCOUS_STD * sheet) ** 2
    spread = np.linalg.inv(H)
    theta = spread @ g
    fitted = A @ theta
    K, offset, viscous, friction = (float(value) for value in theta)
    if K <= 0.0 or offset < -0.5 * K * base.stroke:
        raise CommissioningError(
            f'the force does not rise with the position (K = {K:.3g} N/m): '
            'check area, plug_diameter and the units of the pressures'
        )
    return Balance(
        K,
        max(0.0, offset / (K * base.stroke)),
        max(0.0, viscous),
        abs(friction),
        math.sqrt(spread[0, 0]),
        misfit,
        x,
        force,
        fitted,
    )


def _means(signal: NDArray[Any], width: int) -> NDArray[np.float64]:
    """Return the means of blocks of a signal, NaN where a sample is missing."""
    n = len(signal) // width
    means: NDArray[np.float64] = signal[: n * width].reshape(n, width).mean(axis=1)
    return means


def tune(
    columns: Mapping[str, NDArray[Any]], base: Settings, balance: Balance
) -> tuple[Settings, float, list[str]]:
    """
    Set the constants by the rules for another actuator.

    a4 = a5 = K/m, a1 = s2/m; Phi is expected about 1.4 Fc/(m L); delta = 0.075 Phi/(k2 + a1);
    dz = 2 delta and at least four standard deviations of the noise; rho_min = 3.3 dz;
    gw = 33 (k2 + a1)/(1.93 T); g5 = 0.87 (k2 + a1).

    :param columns: the recording.
    :param base: settings with the data sheet.
    :param balance: the force balance.
    :return: settings, noise of xi2 [1/s], remarks.
    """
    remarks = []
    alpha1, alpha5 = balance.viscous / base.mass, balance.stiffness / base.mass
    pole = base.k2 + alpha1
    phi = 1.4 * balance.friction / (base.mass * base.stroke)
    delta = _digits(max(0.075 * phi / pole, 1e-4))
    scaled = base.replace(
        stiffness=_digits(balance.stiffness, 5),
        preload=_digits(balance.preload),
        alpha1=_digits(alpha1),
        alpha4=_digits(alpha5, 5),
        alpha5=_digits(alpha5, 5),
        delta=delta,
        dz=2.0 * delta,
        rho_min=_digits(6.6 * delta),
        g5=_digits(0.87 * pole),
        gw=_digits(33.0 * pole / (1.93 * (base.t_learn - base.t_w))),
    )
    for wn in BANDWIDTHS:
        scaled = scaled.replace(wn=wn)
        state = run(columns, scaled).estimator.state[0]
        noise = 1.4826 * float(state.noise) / pole
        if 4.0 * noise <= scaled.dz:
            break
    if 4.0 * noise > scaled.dz:
        remarks.append(
            f'sensor noise is {noise:.2g} 1/s in the residual: the dead-zone is '
            'widened, small faults take longer to show; damp the pressure '
            'transmitters or calibrate their span to what is needed'
        )
        dz = _digits(4.0 * noise)
        scaled = scaled.replace(dz=dz, rho_min=_digits(3.3 * dz))
    share = 4.0 * balance.stiffness_std / balance.stiffness
    if share > 0.02:
        remarks.append(f'stiffness is known to {100.0 * share:.1f} % only: record more motion')
    return scaled, noise, remarks


def watched(result: Result, settings: Settings) -> NDArray[np.bool_]:
    """
    Tell which samples were monitored away from the stops.

    :param result: a recording through estimator and detector.
    :param settings: the settings used.
    :return: mask.
    """
    e = result.estimates
    x = e['x1_hat'] + e['xi1'] - settings.preload
    mask: NDArray[np.bool_] = (
        result.accepted
        & (e['phase'] == PHASE_MONITOR)
        & (x > settings.gate_low)
        & (x < 1.0 - settings.gate_high)
    )
    return mask


def set_limit(result: Result, settings: Settings, days: float) -> Limit | None:
    """
    Find the ratio that is reached once in a number of days, from its largest values.

    A decision takes `decide_m` samples in a row or nearly so; their smallest ratio counts. The
    largest of each window of 10 s is fitted by a Gumbel distribution, by moments; its interval
    comes from 200 resamplings with a fixed seed.

    :param result: a fault-free recording through estimator and detector.
    :param settings: the settings used.
    :param days: at most one false alarm in so many days.
    :return: the limit; None where fewer than 20 windows were monitored.
    """
    counts = watched(result, settings)
    ratio = np.where(counts, result.decisions['ratio'], 0.0)
    need = settings.decide_m
    lasting = np.min([ratio[i : len(ratio) - need + 1 + i] for i in range(need)], axis=0)
    window = max(need, round(BLOCK * settings.sample_rate))
    n = len(lasting) // window
    blocks = lasting[: n * window].reshape(n, window)
    full = counts[: n * window].reshape(n, window).mean(axis=1) > 0.5
    maxima = blocks[full].max(axis=1) if n else np.zeros(0)
    if len(maxima) < LEAST_BLOCKS:
        return None
    location, scale = _gumbel(maxima)
    rng = np.random.default_rng(0)
    draws = [_gumbel(rng.choice(maxima, len(maxima))) for _ in range(200)]
    wanted = days * DAY / BLOCK
    low, high = np.percentile([_level(a, b, wanted) for a, b in draws], [5.0, 95.0])
    return Limit(
        _digits(_level(location, scale, wanted)),
        float(low),
        float(high),
        days,
        len(maxima) * BLOCK / 3600.0,
        len(maxima),
        float(maxima.max()),
        maxima,
        location,
        scale,
    )


def _gumbel(maxima: NDArray[np.float64]) -> tuple[float, float]:
    scale = max(float(np.std(maxima, ddof=1)) * math.sqrt(6.0) / math.pi, 1e-9)
    return float(np.mean(maxima)) - 0.5772156649 * scale, scale


def _level(location: float, scale: float, blocks: float) -> float:
    return location - scale * math.log(-math.log1p(-1.0 / max(blocks, 2.0)))


def _digits(value: float, digits: int = 3) -> float:
    return float(f'{value:.{digits}g}')
