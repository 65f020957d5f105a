# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Valves that are not the model inside the monitor: a simulator of its own for the tests.

Shares no code with the package or with damadics_plant: true stick-slip by impulses, choked and
subsonic flow after ISO 6358, isothermal chamber, four positioners, either action, either
direction of flow, a plug force table that is not the data sheet's, transmitters with lags.
"""

from dataclasses import dataclass

import numba
import numpy as np

RT, ATM, G = 287.0 * 293.0, 101325.0, 9.81
POSITIONERS = ('P', 'PI', 'bang', 'piezo')
NODES = np.r_[0.0:0.91:0.1, 0.99, 1.0]
SHEET_KM = np.array([1.0, 0.95, 0.9, 0.85, 0.785, 0.725, 0.67, 0.61, 0.555, 0.5, 0.45, 0.4])


@dataclass(frozen=True)
class Valve:
    """One valve; SI units, X = 0 open, 1 closed."""

    stroke: float = 0.0381
    area: float = 0.029
    stiffness: float = 61e3
    preload: float = 0.25  # of the stroke
    mass: float = 3.0
    dead_volume: float = 4e-3
    dry: float = 0.03  # Coulomb friction as a share of K L
    asymmetry: float = 0.0  # share by which closing rubs more, opening less
    static: float = 1.3  # fs / fc
    stribeck: float = 1.2e-3  # m/s
    viscous: float = 0.02  # c L / (K L): share of K L at one stroke per second
    ageing: float = 0.0  # growth of the static friction per decade of rest
    hysteresis: float = 0.0  # of the diaphragm, share of K L
    air_to: str = 'close'
    flow_to: str = 'open'
    plug_diameter: float = 0.05
    plug_gain: float = 1.0  # truth / data sheet
    plug_shape: float = 0.0  # smooth shape error
    positioner: str = 'P'
    supply: float = 600e3
    orifice: float = 2.2e-9  # sonic conductance [m3/(s Pa)]
    p1: float = 3.5e6
    p2: float = 2.6e6
    pulsation: float = 0.02  # of P1
    installed: float = 0.0  # share of P1 - P2 that is lost when fully open
    ps_lag: float = 0.0
    dp_lag: float = 0.0
    play: float = 0.0  # of the position sensor, share of the stroke
    noise_x: float = 5e-4
    noise_ps: float = 150.0
    noise_p: float = 2e3

    @property
    def force(self):
        """K L [N]."""
        return self.stiffness * self.stroke


@dataclass(frozen=True)
class Course:
    """What changes with time: a fault as a step, the day, the process."""

    fault_at: float = 1e12
    dry: float = 0.0  # change of the dry friction
    viscous: float = 0.0
    spring: float = 0.0
    ramp: float = 1e-3  # s over which the fault grows
    friction_day: float = 0.0  # amplitude over 24 h
    spring_day: float = 0.0
    zero_day: float = 0.0  # of the position sensor
    run_in: float = 0.0  # share of friction lost, time constant a day
    supply_swing: float = 0.0
    supply_period: float = 21600.0
    supply_steps: float = 0.0  # compressor: share lost, on and off
    p1_swing: float = 0.0  # Pa
    p1_period: float = 14400.0
    day: float = 86400.0


@numba.njit(cache=True)
def _mass_flow(c, up, down):
    """Return the mass flow of an orifice after ISO 6358, b = 0.3; absolute pressures."""
    if up <= down:
        return 0.0
    r = down / up
    if r < 0.3:
        return c * up * 1.185
    return c * up * 1.185 * np.sqrt(max(0.0, 1.0 - ((r - 0.3) / 0.7) ** 2))


@numba.njit(cache=True)
def _advance(cv, P, T, km, kind, dt, sub, out, p1, p2, supply, state):
    (
        L,
        A,
        K,
        x0,
        m,
        V0,
        fc,
        asym,
        fsr,
        vs,
        c,
        age,
        hyst,
        air,
        flow,
        plug,
        orifice,
        play,
        installed,
    ) = P
    (t_fault, d_dry, d_visc, d_spring, ramp, f_day, k_day, run_in, day) = T
    x, v, p, integ, op, clock, z, seat, rest = state
    weight = m * 9.81
    for i in range(len(cv)):
        sp = cv[i]
        for j in range(sub):
            t = (i + j / sub) * 0.005
            w = 2 * np.pi * t / day
            grown = min(max((t - t_fault) / ramp, 0.0), 1.0)
            friction = (1 + d_dry * grown) * (1 + f_day * np.sin(w))
            friction *= 1 - run_in * (1 - np.exp(-t / day))
            k = K * (1 + d_spring * grown) * (1 + k_day * np.sin(w))
            X = x / L
            # positioner, on the stem position itself
            e = sp - X  # > 0: close
            if air < 0:
                e = -e
            if kind == 0:
                op = min(max(12.0 * e, -1.0), 1.0)
            elif kind == 1:
                u = 6.0 * e + integ
                op = min(max(u, -1.0), 1.0)
                if abs(e) < 0.1 and abs(u) < 1.0:
                    integ = min(max(integ + 2.0 * e * dt, -0.3), 0.3)
                if abs(e) > 0.1:
                    integ = 0.0
            else:
                clock -= dt
                if clock <= 0.0:
                    clock = 0.05 if kind == 2 else 0.02
                    if kind == 2:
                        op = 0.0 if abs(e) < 0.006 else (1.0 if e > 0 else -1.0)
                        if abs(e) < 0.03:
                            op *= 0.15
                    else:
                        op = 0.0 if abs(e) < 0.004 else min(max(e / 0.08, -1.0), 1.0)
                        if op != 0.0 and abs(op) < 0.05:
                            op = 0.05 if op > 0 else -0.05
            vol = V0 + A * (x if air > 0 else L - x)
            rate = A * (v if air > 0 else -v)
            dead = 0.01 if kind < 2 else 0.0
            mdot = 0.0
            if op > dead:
                mdot = _mass_flow(orifice * op, supply[i] + 101325.0, p)
            elif op < -dead:
                mdot = -_mass_flow(-orifice * op, p, 101325.0)
            p = max(p + dt * (84091.0 * mdot - p * rate) / vol, 2e4)
            # forces, positive closes
            s = min(max(X, 0.0), 1.0)
            if s >= 0.99:
                g = km[10] + (km[11] - km[10]) * (s - 0.99) * 100
            elif s >= 0.9:
                g = km[9] + (km[10] - km[9]) * (s - 0.9) / 0.09
            else:
                n = int(s * 10)
                g = km[n] + (km[n + 1] - km[n]) * (s * 10 - n)
            dp = (p1[i] - p2[i]) * (1 - installed * (1 - s))
            f = weight - flow * dp * plug / g + air * A * (p - 101325.0)
            f -= k * (x + x0 * L) if air > 0 else -k * (L - x + x0 * L)
            if hyst > 0.0:
                z += v * dt / 3e-4 * (1 - (z if v > 0 else -z))
                f -= hyst * z
            side = 1 + asym if v > 0 else 1 - asym
            if v == 0.0:
                rest += dt
                Fs = fc * friction * fsr * (1 + age * np.log10(1 + rest))
                Fs *= 1 + asym if f > 0 else 1 - asym
                if abs(f) > Fs:
                    v = dt / m * (f - (Fs if f > 0 else -Fs))
                    rest = 0.0
            else:
                Fd = fc * friction * side * (1 + (fsr - 1) * np.exp(-((v / vs) ** 2)))
                new = v + dt / m * (f - (Fd if v > 0 else -Fd))
                new /= 1 + dt / m * c * (1 + d_visc * grown)
                if new * v < 0:
                    new = 0.0
                v = new
                rest = 0.0
            x += v * dt
            if x <= 0.0:
                x = 0.0
                v = max(v, 0.0)
            elif x >= L:
                x = L
                v = min(v, 0.0)
        seat = min(max(seat, x / L - play / 2), x / L + play / 2)
        out[i, 0] = seat
        out[i, 1] = p - 101325.0
        out[i, 2] = x / L
        out[i, 3] = v / L
        out[i, 4] = (p1[i] - p2[i]) * (1 - installed * (1 - min(max(x / L, 0.0), 1.0)))
    return x, v, p, integ, op, clock, z, seat, rest


def _lag(signal, tau, period):
    if tau <= 0.0:
        return signal
    y, a, value = np.empty_like(signal), 1 - np.exp(-period / tau), signal[0]
    for i, s in enumerate(signal):
        value += a * (s - value)
        y[i] = value
    return y


_lag = numba.njit(cache=True)(_lag)


def simulate(valve, cv, course=None, seed=0, rate=200.0, dt=5e-4):
    """Return the columns of a recording; `cv` is the command at 200 Hz, 1 = closed."""
    v, c = valve, course or Course()
    rng = np.random.default_rng([seed, 11])
    n, period = len(cv), 0.005
    t = np.arange(n) * period
    km = SHEET_KM / (v.plug_gain * (1 + v.plug_shape * np.sin(2 * np.pi * NODES + 0.7)))
    p1 = v.p1 * (1 + v.pulsation * np.sin(2 * np.pi * 0.1 * t + rng.uniform(0, 6)))
    p1 += c.p1_swing * np.sin(2 * np.pi * t / c.p1_period)
    p2 = v.p2 * (1 + 0.01 * np.sin(2 * np.pi * 0.3 * t + rng.uniform(0, 6)))
    supply = v.supply * (1 + c.supply_swing * np.sin(2 * np.pi * t / c.supply_period))
    if c.supply_steps:
        supply *= 1 - c.supply_steps * (np.floor(t / 300.0) % 2)
    air, flow = (1.0 if v.air_to == 'close' else -1.0), (1.0 if v.flow_to == 'open' else -1.0)
    P = (
        v.stroke,
        v.area,
        v.stiffness,
        v.preload,
        v.mass,
        v.dead_volume,
        v.dry * v.force,
        v.asymmetry,
        v.static,
        v.stribeck,
        v.viscous * v.force / v.stroke,
        v.ageing,
        v.hysteresis * v.force,
        air,
        flow,
        np.pi * v.plug_diameter**2 / 4,
        v.orifice,
        v.play,
        v.installed,
    )
    T = (
        c.fault_at,
        c.dry,
        c.viscous,
        c.spring,
        c.ramp,
        c.friction_day,
        c.spring_day,
        c.run_in,
        c.day,
    )
    start = 0.0 if air > 0 else v.stroke
    state = (start, 0.0, ATM, 0.0, 0.0, 0.0, 0.0, start / v.stroke, 0.0)
    out = np.empty((n, 5))
    sub = round(period / dt)
    _advance(cv, P, T, km, POSITIONERS.index(v.positioner), dt, sub, out, p1, p2, supply, state)
    x = out[:, 0] + c.zero_day * np.sin(2 * np.pi * t / c.day)
    shown = p2 + _lag(out[:, 4], v.dp_lag, period)
    columns = {
        'stamp': np.round(t * 1e9).astype(np.int64),
        'cv': cv.copy(),
        'x1': x + v.noise_x * rng.standard_normal(n),
        'p1': shown + v.noise_p * rng.standard_normal(n),
        'p2': p2 + v.noise_p * rng.standard_normal(n),
        't1': np.full(n, 20.0),
        'flow': np.full(n, np.nan),
        'ps': _lag(out[:, 1], v.ps_lag, period) + v.noise_ps * rng.standard_normal(n),
    }
    step = round(200.0 / rate)
    return {name: np.ascontiguousarray(column[::step]) for name, column in columns.items()}


def sheet(valve, **changes):
    """Return what the data sheet says: geometry, spring, not friction, table, transmitters."""
    return {
        'stroke': valve.stroke,
        'area': valve.area,
        'stiffness': valve.stiffness,
        'mass': valve.mass,
        'plug_diameter': valve.plug_diameter,
        'supply_pressure': valve.supply,
        'chamber_volume': valve.dead_volume,
        **changes,
    }
