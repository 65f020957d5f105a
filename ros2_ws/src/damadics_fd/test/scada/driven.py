# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Short records of a control room: the stated actuator, with faults of the benchmark."""

import math

import numpy as np
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, valve_flow
from damadics_fd.core.scada.model import FAULTS, STEM, advance_stem, start_stem
from damadics_fd.core.scada.settings import ScadaSettings

SETTINGS = ScadaSettings(learn_from_s=30.0, learn_s=270.0, t_on_s=40.0, settle_s=20.0)
NOISE = 0.0014


def driven(
    seconds: int,
    seed: int,
    at: int = 1 << 30,
    swing: float = 1.0,
    jump: float = math.nan,
    air: float = 1.0,
    centre: float = 0.5,
    every: int = 40,
    **faults: float,
) -> np.ndarray:
    """
    Return rows t, CV, X', P1', P2', T1', F' at 1 Hz of a valve that its command moves.

    :param at: from when on the faults act [s]; f7: [K], f17: share of P1.
    :param swing: how much the command moves.
    :param jump: of the command every so many seconds, which is then held between samples.
    :param air: in the chamber, over what pressure and volume say.
    :param centre: of the command's motion.
    """
    rng = np.random.default_rng(seed)
    act = SETTINGS.record()['act'][0]
    stem, none, some = np.zeros(1, STEM), np.zeros(1, FAULTS), np.zeros(1, FAULTS)
    for name, strength in faults.items():
        some[name] = strength
    t = np.arange(float(seconds))
    cv = centre + swing * (
        0.25 * np.sin(2 * np.pi * 0.02 * t) + 0.1 * np.sin(2 * np.pi * 0.007 * t)
    )
    held = not math.isnan(jump)
    if held:
        cv = cv - jump * (t // every % 2)
    cv = np.clip(cv, 0.0, 1.0)
    p1, p2 = np.full(seconds, 3.5e6), np.full(seconds, 2.6e6)
    t1 = np.full(seconds, 43.0)
    p1[at:] *= 1.0 - faults.get('f17', 0.0)
    t1[at:] += faults.get('f7', 0.0)
    some['f7'] = some['f17'] = 0.0
    drop = (p1 - p2) / P_RANGE
    start_stem(stem[0], act, 0.0)
    stem[0].m_a *= air
    x, flow = np.empty(seconds), np.empty(seconds)
    for k in range(seconds):
        fault = some[0] if k >= at else none[0]
        before = max(k - 1, 0)
        x[k] = advance_stem(
            stem[0],
            act,
            fault,
            k - 1.0,
            k,
            cv[before],
            cv[before if held else k],
            drop[before],
            drop[k],
            0.0,
            0.0,
        )
        true = x[k] / (1.0 + 1.25 * fault.f13)
        offset = 0.2 * fault.f2 - 0.1 * fault.f3
        scale = (1.0 - 0.2 * fault.f2) * (1.0 + 0.1 * fault.f3)
        f = valve_flow(act, true, p1[k], p2[k], t1[k], offset, scale, 0.1 * fault.f6, fault.f18)
        flow[k] = min(1.0, (1.0 - 0.05 * fault.f5) * (1.0 - fault.f19) * f / F_RANGE)
    clean = np.column_stack([x, p1 / P_RANGE, p2 / P_RANGE, t1 / T_RANGE, flow])
    noisy = clean + rng.normal(0.0, NOISE, clean.shape)
    noisy[:, -1] = np.clip(noisy[:, -1], 0.0, 1.0)  # the meter's range
    return np.column_stack([t, cv, noisy])


def following(n: int, seed: int) -> np.ndarray:
    """Return rows of a stem that follows its command two seconds later; nothing else is known."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(n))
    cv = 0.5 + 0.2 * np.sin(2 * np.pi * 0.015 * t) + 0.1 * np.sin(2 * np.pi * 0.004 * t)
    rows = np.full((n, 7), np.nan)
    rows[:, 0], rows[:, 1] = t, cv
    rows[:, 2] = np.r_[cv[:1], cv[:1], cv[:-2]] + rng.normal(0.0, NOISE, n)
    return rows


def late(cv: np.ndarray, seed: int, lag: float = 1.2, play: float = 0.006) -> np.ndarray:
    """Return rows of a stem with dead time, lag, a limited rate and play, without the process."""
    n, parts, dead = len(cv), 10, 4
    rate = 0.2 / parts
    x = np.empty(n)
    at = held = cv[0]
    for k in range(n):
        x[k] = held
        for part in range(parts):
            command = cv[k] if part >= dead else cv[max(k - 1, 0)]
            at += min(max((command - at) / (parts * lag), -rate), rate)
            held = min(max(held, at - play / 2), at + play / 2)
    rows = np.full((n, 7), np.nan)
    rows[:, 0], rows[:, 1] = np.arange(float(n)), cv
    rows[:, 2] = x + np.random.default_rng(seed).normal(0.0, NOISE, n)
    return rows


def sticking(cv: np.ndarray, seed: int, stick: float) -> np.ndarray:
    """Return rows of a stem that friction holds until its positioner is off by `stick`."""
    rng = np.random.default_rng(seed)
    x = np.empty(len(cv))
    at, held = cv[0], cv[0]
    for k, command in enumerate(cv.tolist()):
        at += 0.5 * (command - at)
        if abs(at - held) > stick:  # it slips, and stops before it is there
            held = at - math.copysign(0.4 * stick, at - held)
        x[k] = held
    rows = np.full((len(cv), 7), np.nan)
    rows[:, 0], rows[:, 1] = np.arange(float(len(cv))), cv
    rows[:, 2] = x + rng.normal(0.0, NOISE, len(cv))
    return rows


def wandering(n: int, seed: int) -> np.ndarray:
    """Return a command that wanders slowly and never jumps."""
    rng = np.random.default_rng(seed)
    cv = np.empty(n)
    level = 0.0
    for k, kick in enumerate(rng.normal(size=n).tolist()):
        level = 0.998 * level + 0.0065 * kick
        cv[k] = 0.5 + level
    return np.clip(cv, 0.0, 1.0)


def restless(n: int, seed: int, spread: float = 0.08, memory: float = 3.0) -> np.ndarray:
    """Return a command that goes elsewhere within seconds, as that of a fast loop does."""
    rng = np.random.default_rng(seed)
    keep = math.exp(-1.0 / memory)
    cv = np.empty(n)
    level = 0.0
    for k, kick in enumerate(rng.normal(size=n).tolist()):
        level = keep * level + math.sqrt(1.0 - keep * keep) * kick
        cv[k] = 0.5 + spread * level
    return np.clip(cv, 0.0, 1.0)
