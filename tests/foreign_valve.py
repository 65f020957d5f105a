# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Valves that are not the benchmark's, for tests: nothing here is shared with `core` or the plant.

A positioner with a spool drives air into a chamber; the spring turns its pressure into a position;
packing holds the stem within a play. Flow follows IEC 60534-2-1 (the test compares it with the
package `fluids`). Everything is normalised: chamber pressure p = (x + 0.25) spring.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np

STEP = 0.05  # s
WATER = 985.0  # kg/m3, kept constant
VAPOUR = 8.6e3  # Pa, at 43 degC
PRELOAD = 0.25


@dataclass(frozen=True)
class Kind:
    """One kind of valve; air is a factor on the speed of the stem."""

    kv: float = 120.0
    trim: str = 'equal'
    air: float = 1.0
    medium: str = 'liquid'
    air_to: str = 'close'
    p1: float = 3.5e6
    p2: float = 2.6e6
    flow_range: float = 0.0  # kg/s; 0: twice the flow at half stroke
    play: float = 0.006


@numba.njit
def _stem(cv, air, opens, play, fault_at, fault, strength):  # pragma: no cover
    """Return the position at every second for a command at every second."""
    n = cv.size
    x_out = np.empty(n)
    p = (cv[0] if not opens else 1.0 - cv[0]) + 0.25
    x = p - 0.25
    held = x
    u1 = u2 = x
    for k in range(n):
        x_out[k] = held if not opens else 1.0 - held
        spring = 1.0
        sensor = 1.0
        top = 1.0
        if k >= fault_at:
            if fault == 11:
                spring = 1.0 - strength
            if fault == 13:
                sensor = 1.0 + 1.25 * strength
            if fault == 1:
                top = 1.0 - strength
        for _ in range(20):
            command = cv[k] if not opens else 1.0 - cv[k]
            u1 += 0.05 / 0.3 * (command - u1)
            u2 += 0.05 / 0.3 * (u1 - u2)
            seen = held * sensor if not opens else 1.0 - (1.0 - held) * sensor
            e = 40.0 * (u2 - seen)
            e = min(max(e, -1.0), 1.0)
            if abs(e) < 0.08:
                e = 0.0
            drive = 0.16 * e * math.sqrt(max(2.5 - p, 0.0)) if e > 0 else 0.12 * e * math.sqrt(p)
            p = min(max(p + 0.05 * air * drive, 0.0), 2.5)
            x = min(max(p / spring - 0.25, -0.1), 1.1)
            held = min(max(held, x - play / 2), x + play / 2)
            held = min(max(held, 0.0), top if not opens else 1.0)
            if opens and 1.0 - held > top:
                held = 1.0 - top
        if k >= fault_at and fault == 4:
            held = x_out[k] if not opens else 1.0 - x_out[k]
        if k >= fault_at and fault == 13:
            x_out[k] = min(max(x_out[k] * sensor, 0.0), 1.0)
    return x_out


def capacity(kind: Kind, x: np.ndarray) -> np.ndarray:
    """Return Kv at position x, 0 open .. 1 closed."""
    opening = np.clip(1.0 - x, 0.0, 1.0)
    if kind.trim == 'linear':
        return kind.kv * opening
    return kind.kv * np.where(opening > 0.02, 50.0 ** (opening - 1.0), opening / 0.02 / 50.0)


def mass_flow(kind: Kind, x: np.ndarray, p1: np.ndarray, p2: np.ndarray) -> np.ndarray:
    """Return kg/s by IEC 60534-2-1 for turbulent flow without fittings."""
    kv = capacity(kind, x)
    drop = p1 - p2
    if kind.medium == 'liquid':
        drop = np.minimum(drop, 0.9**2 * (p1 - 0.96 * VAPOUR))
        return kv * np.sqrt(drop / 1e5 * 1000.0 / WATER) * WATER / 3600.0
    ratio, gamma = 0.7, 1.4 / 1.4
    share = np.minimum(drop / p1, gamma * ratio)
    y = 1.0 - share / (3.0 * gamma * ratio)
    temperature, molar, n6 = 316.15, 28.96, 3.16  # n6 for kPa
    density = p1 * molar / (8314.46 * temperature)
    return n6 / 3600.0 * kv * y * np.sqrt(share * (p1 / 1e3) * density) * math.sqrt(1.0)


def record(
    kind: Kind,
    cv: np.ndarray,
    seed: int,
    fault: int = 0,
    strength: float = 0.0,
    at: int = 1 << 40,
    noise: float = 1.414e-3,
) -> dict[str, np.ndarray]:
    """Return columns at 1 Hz in SI units; fault 19 scales the flow by 1 - strength."""
    rng = np.random.default_rng(seed)
    n = len(cv)
    x = _stem(cv, kind.air, kind.air_to == 'open', kind.play, at, fault, strength)
    wave = np.convolve(rng.normal(size=n + 600), np.ones(600) / 600.0, 'valid')[:n] * 24.5
    p1 = kind.p1 * (1.0 + 0.01 * wave)
    p2 = kind.p2 * (1.0 + 0.005 * np.roll(wave, 777))
    true_x = x / (1.0 + 1.25 * strength) if fault == 13 else x
    true_x = np.where(np.arange(n) >= at, true_x, x)
    flow = mass_flow(kind, true_x, p1, p2)
    if fault == 19:
        flow = np.where(np.arange(n) >= at, flow * (1.0 - strength), flow)
    end = kind.flow_range or 2.0 * float(
        mass_flow(kind, np.array([0.5]), np.array([kind.p1]), np.array([kind.p2]))[0]
    )
    full = 1.2 * kind.p1
    return {
        'stamp': np.arange(n, dtype=np.int64) * 1_000_000_000,
        'cv': cv,
        'x1': np.clip(x + rng.normal(size=n) * noise, 0.0, 1.0),
        'p1': p1 + rng.normal(size=n) * noise * full,
        'p2': p2 + rng.normal(size=n) * noise * full,
        't1': np.full(n, 43.0) + rng.normal(size=n) * 0.1,
        'flow': np.clip(flow + rng.normal(size=n) * noise * end, 0.0, end),
    }


def load(n: int, seed: int, centre: float = 0.55, spread: float = 0.12) -> np.ndarray:
    """Return a command that wanders, with a step every half hour or so."""
    rng = np.random.default_rng(seed + 5)
    pull = math.exp(-1.0 / 600.0)
    kicks = rng.normal(size=n) * spread * math.sqrt(1.0 - pull * pull)
    walk = np.empty(n)
    level = 0.0
    for i, kick in enumerate(kicks.tolist()):
        level = pull * level + kick
        walk[i] = level
    steps = np.repeat(rng.uniform(-0.08, 0.08, n // 1800 + 1), 1800)[:n]
    return np.clip(centre + walk + steps, 0.0, 1.0)
