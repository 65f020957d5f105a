# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Identify a valve for mode monitor: settings, verdict, and what they rest on."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from damadics_fd.commands.commission.checks import (
    check_directions,
    check_units,
    dead_signals,
    ranges,
)
from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.forces.balance import BLOCK, Balance, find_balance
from damadics_fd.commands.commission.forces.breakaway import breakaway
from damadics_fd.commands.commission.limit import Limit, set_limit, watched
from damadics_fd.commands.commission.signals import APART, Signals, blocks, gather
from damadics_fd.commands.commission.tuning import tune
from damadics_fd.commands.commission.verdict import (
    GOOD_FRICTION,
    GOOD_SPRING,
    Found,
    another_plug,
    another_valve,
    hidden_friction,
    parts_differ,
    sheet_differs,
    smallest,
    unchecked,
)
from damadics_fd.commands.commission.wrong import told, without_wrong_samples
from damadics_fd.core.monitor import run
from damadics_fd.core.result import Columns, Result
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import LIMITED, OK, REFUSED, FaultFree, Identified
from damadics_fd.core.signature.settings import MIN_RATE

SAME_SPRING = 0.05  # share by which the stiffness of recordings of one valve may differ
JUMPY = 0.2  # share of jumps in the motion from which it is told
SEEN = 1.5  # factor on the largest ratio seen: a limit is no lower


@dataclass(frozen=True)
class Proposal:
    """Hold proposed settings and what they rest on."""

    settings: Settings
    balance: Balance
    limit: Limit | None  # None where too little was monitored
    result: Result  # the recordings with the proposed settings
    columns: Columns  # of all recordings
    noise: float  # standard deviation of xi2 from sensor noise [1/s]
    minute: Found
    hour: Found
    remarks: tuple[str, ...]
    limiting: tuple[str, ...]  # why the verdict is not ok
    refusing: tuple[str, ...]  # why it is refused
    sheet_diameter: float  # [m] of the plug, as stated

    @property
    def verdict(self) -> str:
        """OK, LIMITED or REFUSED."""
        return REFUSED if self.refusing else LIMITED if self.limiting else OK

    def identified(self, defaults: Settings) -> Identified:
        """
        Return what every mode returns.

        :param defaults: settings that need not be written.
        :return: settings that differ, report and verdict.
        """
        plain, present = defaults.to_dict(), self.settings.to_dict()
        return Identified(
            self.verdict,
            {name: value for name, value in present.items() if value != plain[name]},
            tuple(report(self)),
            (*self.refusing, *self.limiting),
            self.result.estimator.learned() if self.result.estimator.monitoring else {},
            {
                'friction_in_a_minute': _rounded(self.minute.friction),
                'spring_in_a_minute': _rounded(self.minute.spring),
                'friction_in_an_hour': _rounded(self.hour.friction),
                'spring_in_an_hour': _rounded(self.hour.spring),
                'misfit': _rounded(self.balance.misfit / max(self.balance.total, 1e-9)),
            },
        )


def _rounded(share: float) -> float:
    return float(f'{min(share, 1e6):.3g}')


def identify(
    recordings: Sequence[FaultFree],
    sheet: Settings,
    given: Collection[str] = (),
    days: float = 30.0,
) -> Proposal:
    """
    Identify a valve from fault-free recordings in which it moves both ways.

    :param recordings: of one valve.
    :param sheet: monitor settings with what the data sheet says: mass, stroke, area, plug.
    :param given: names of the settings that the user stated.
    :param days: at most one false alarm in so many days.
    :return: the proposal.
    :raises CommissioningError: where units or directions are wrong or the recordings show too
        little.
    """
    for recording in recordings:
        check_units(recording.columns)
    recordings, wrong = without_wrong_samples(recordings)
    signals = gather(recordings)
    check_directions(blocks(signals, BLOCK), _flow(recordings, signals))
    if signals.rate < MIN_RATE:
        raise CommissioningError(
            f'{signals.rate:g} Hz is too slow for mode monitor, which needs {MIN_RATE:g} Hz to '
            'tell causes apart: take --mode scada'
        )
    base = sheet.replace(sample_rate=signals.rate, **ranges(recordings, sheet))
    dead = dead_signals(recordings)
    balance = find_balance(signals, base, given, pressures=not dead)
    _same_valve(recordings, base, given)
    if 'hysteresis' not in given:
        start = breakaway(signals, balance.settings, balance.friction)
        settings = balance.settings.replace(
            hysteresis=float(f'{start.hysteresis:.3g}'),
            hysteresis_std=float(f'{start.hysteresis_std:.2g}'),
        )
        balance = replace(balance, settings=settings)
    proposal = _propose(recordings, base, given, days, balance, dead)
    return replace(proposal, remarks=(*told(wrong), *proposal.remarks))


def _propose(
    recordings: Sequence[FaultFree],
    sheet: Settings,
    given: Collection[str],
    days: float,
    balance: Balance,
    dead: list[str],
) -> Proposal:
    columns = joined(recordings)
    quiet = balance.settings.replace(signature=False, own_alarm=False)
    settings, noise, remarks = tune(columns, balance, quiet)
    settings = settings.replace(signature=sheet.signature, own_alarm=sheet.own_alarm)
    result = run(columns, settings)
    limiting: list[str] = []
    refusing: list[str] = []
    settings, limit, reasons = _limited(settings, result, days)
    limiting += reasons
    minute, hour = smallest(balance, 60.0), smallest(balance, 3600.0)
    hidden = hidden_friction(balance)
    missed = (
        f'friction below +{100.0 * hour.friction:.0f} % and spring changes below '
        f'{100.0 * hour.spring:.2g} % will be missed'
    )
    if dead:
        text = f'{"; ".join(dead)}; {missed}'
        (refusing if hidden or 'ps' in text[:3] else limiting).append(text)
    if hidden:
        refusing.append(
            f'the force balance leaves {balance.misfit:.3g} N, more than half the friction of '
            f'{balance.total:.3g} N: {missed}; check P1, P2, ps, area, plug_diameter'
        )
    elif not dead and (hour.friction > GOOD_FRICTION or hour.spring > GOOD_SPRING):
        limiting.append(missed)
    limiting += parts_differ(balance)
    limiting += another_valve(balance, sheet, given)
    limiting += another_plug(balance, sheet, given)
    limiting += unchecked(balance, sheet, given)
    if result.detections:
        first = (result.detections[0].stamp - int(columns['stamp'][0])) * 1e-9
        limiting.append(
            f'the recording itself raises {len(result.detections)} alarms, the first at '
            f'{first:.1f} s: a fault in it? see --until'
        )
    jumps = blocks(gather(recordings), BLOCK, settings.ps_lag).jumps
    if jumps > JUMPY:
        remarks.append(
            f'the stem sticks and slips ({100.0 * jumps:.0f} % of its motion are jumps): friction '
            'is read up to a third too high and its changes too small, false alarms are likelier; '
            'see to the packing, or to a positioner that hunts'
        )
    remarks += sheet_differs(balance, sheet, given)
    remarks += [f'not determined: {name}' for name in balance.undetermined]
    return Proposal(
        settings,
        balance,
        limit,
        result,
        columns,
        noise,
        minute,
        hour,
        tuple(remarks),
        tuple(limiting),
        tuple(refusing),
        sheet.plug_diameter,
    )


def _limited(
    settings: Settings, result: Result, days: float
) -> tuple[Settings, Limit | None, list[str]]:
    """Raise the levels to the limit that keeps the budget of false alarms."""
    limit = set_limit(result, settings, days) if result.estimator.monitoring else None
    ratio, reasons = 1.0, []
    if limit is not None:
        ratio = max(limit.ratio, SEEN * limit.seen)
    else:
        why = 'too little was monitored'
        if not result.estimator.monitoring:
            why = f'the recording does not finish learning ({result.estimator.status})'
        reasons.append(f'no limit can be proposed: {why}; record longer')
        ratios = result.decisions['ratio'][watched(result, settings)]
        ratio = SEEN * float(np.max(ratios, initial=0.0))
    if ratio > 1.0:
        ratio = float(f'{ratio:.3g}')
        step = ratio / settings.level_maintenance
        settings = settings.replace(
            level_maintenance=ratio,
            level_specification=settings.level_specification * step,
            level_failure=settings.level_failure * step,
        )
    return settings, limit, reasons


def joined(recordings: Sequence[FaultFree]) -> dict[str, NDArray[np.generic]]:
    """
    Put recordings one after the other, a minute apart.

    :param recordings: of one valve.
    :return: the columns that all of them have.
    """
    names = set.intersection(*(set(r.columns) for r in recordings))
    columns = {n: np.concatenate([r.columns[n] for r in recordings]) for n in names}
    stamps, begin = [], 0
    for k, recording in enumerate(recordings):
        stamp = np.asarray(recording.columns['stamp'], np.int64)
        shift = 0 if k == 0 else begin - int(stamp[0])
        stamps.append(stamp + shift)
        begin = int(stamp.max()) + shift + round(APART * 1e9)
    columns['stamp'] = np.concatenate(stamps)
    return columns


def _flow(recordings: Sequence[FaultFree], signals: Signals) -> NDArray[np.float64] | None:
    """Return the flow of the blocks of a single recording, where it is measured."""
    if len(recordings) != 1 or 'flow' not in recordings[0].columns:
        return None
    columns = recordings[0].columns
    flow = np.asarray(columns['flow'], float)
    good = np.isfinite(flow)
    if good.mean() < 0.5:
        return None
    t = (np.asarray(columns['stamp'], np.int64) - int(columns['stamp'][0])) * 1e-9
    found: NDArray[np.float64] = np.interp(blocks(signals, BLOCK).t, t[good], flow[good])
    return found


def _same_valve(recordings: Sequence[FaultFree], base: Settings, given: Collection[str]) -> None:
    """Refuse recordings of different valves, naming them."""
    if len(recordings) < 2:
        return
    found = {}
    for recording in recordings:
        try:
            b = find_balance(gather([recording]), base, given)
        except CommissioningError:
            continue  # too short to tell by itself
        found[recording.name] = (b.settings, b.stiffness_std)
    if len(found) < 2:
        return
    middle = float(np.median([s.stiffness for s, _ in found.values()]))
    odd = [
        f'{name} (K = {s.stiffness:.4g} N/m, air to {s.air_to})'
        for name, (s, std) in found.items()
        if abs(s.stiffness - middle) > SAME_SPRING * middle + 4.0 * std
    ]
    actions = {s.air_to for s, _ in found.values()}
    if odd or len(actions) > 1:
        names = ', '.join(odd or [f'{name} (air to {s.air_to})' for name, (s, _) in found.items()])
        raise CommissioningError(
            f'these are not recordings of one valve in one state: {names}; the median is '
            f'K = {middle:.4g} N/m'
        )


def report(proposal: Proposal) -> Iterator[str]:
    """
    Say what was found.

    :param proposal: of `identify`.
    :return: lines to print.
    """
    s, b = proposal.settings, proposal.balance
    yield (
        f'{s.sample_rate:g} Hz; air to {s.air_to}, flow to {s.flow_to}; '
        f'K = {s.stiffness:.0f} +- {2 * b.stiffness_std:.0f} N/m, preload {s.preload:.3f} strokes'
    )
    yield (
        f'dry friction {b.friction:.1f} +- {2 * b.friction_std:.1f} N, viscous {b.viscous:.0f} +- '
        f'{2 * b.viscous_std:.0f} N s/m, {b.stribeck:.1f} N more where it sticks; the balance '
        f'leaves {b.misfit:.1f} N ({100.0 * b.misfit / max(b.total, 1e-9):.0f} % of the friction)'
    )
    if s.hysteresis > 0.0:
        yield (
            f'{s.hysteresis:.1f} +- {2 * s.hysteresis_std:.1f} N of it is hysteresis of the '
            'diaphragm or play, which shares of the friction do not count'
        )
    if s.plug_diameter > 0.0:
        yield (
            f'plug force {b.gain:.2f} of the table, shape +-{100.0 * b.shape:.0f} %; '
            + (
                f'the transmitter of ps lags by {1e3 * s.ps_lag:.0f} +- {2e3 * b.lag.std:.0f} ms, '
                'which is compensated'
                if s.ps_lag > 0.0
                else 'no lag of the transmitter of ps is seen'
            )
        )
    yield (
        f'wn = {s.wn:g} rad/s, delta = {s.delta:g}, dz = {s.dz:g}, rho_min = {s.rho_min:g}, '
        f'gw = {s.gw:g}, g5 = {s.g5:g}; noise of the residual {proposal.noise:.2g} 1/s'
    )
    if proposal.limit:
        yield proposal.limit.statement()
        if s.level_maintenance <= 1.0:
            yield 'The limit stays at 1: the threshold keeps the budget by itself.'
        elif proposal.limit.ratio < SEEN * proposal.limit.seen:
            yield (
                f'The limit is {s.level_maintenance:.2f}, {SEEN:g} times the largest value: a few '
                'strokes stand out, of which such a distribution knows nothing.'
            )
    for time, found in (('a minute', proposal.minute), ('an hour', proposal.hour)):
        yield (
            f'found within {time} of operation like this: friction +-{100 * found.friction:.0f} '
            f'%, stiffness +-{100 * found.spring:.2g} %'
        )
    for remark in proposal.remarks:
        yield f'note: {remark}'
    for reason in (*proposal.refusing, *proposal.limiting):
        yield f'because: {reason}'
    yield f'verdict: {proposal.verdict}'
