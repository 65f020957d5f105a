# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A quickly learned signature, and short records of strokes for it, by the force balance alone."""

import numpy as np
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.step import QUIET, step
from damadics_fd.core.valve.plug import recoveries

DT = 0.025
QUICK = SignatureSettings(
    sample_period=DT,
    start=1.0,
    learn=20.0,
    learn_blocks=20,
    learn_weight=30.0,
    verify=6.0,
    verify_blocks=20,
    stage2_delay=4.0,
    unconfirmed_after=10.0,
    model_error=0.05,
)


def chamber_pressure(c, x, v, dp, dK=0.0, dF=0.0, preload=0.0, held=0.0, table=None):
    """
    Return what the force balance asks for [Pa].

    :param dK: change of stiffness, one number or one for each sample; so are the following.
    :param held: force / FN that the stem bears besides.
    :param table: Km(X) of the plug, if not that of the settings.
    """
    table = c.plug_km if table is None else table
    plug = dp * c.plug_area / recoveries(table, x) / c.force_scale
    friction = (0.0246 * v + 0.0108 * np.tanh(v / 0.004)) * (1.0 + dF)
    u = (1.0 + dK) * (x + c.preload) + preload + friction + held
    return (u - c.weight / c.force_scale + plug) * c.force_scale / c.diaphragm_area


class Strokes:
    """Records of a valve that strokes between random places at random speeds."""

    def __init__(self, seed: int = 1, c: SignatureSettings = QUICK) -> None:
        self.c = c
        self.rng = np.random.default_rng(seed)
        self.t = 0.0
        self.x = 0.5

    def motion(self, seconds: float, rest: float = 0.4, closing: float = 1.0) -> np.ndarray:
        """Return positions; `closing`: share of the usual speed while the stem closes."""
        n = round(seconds / DT)
        parts, count = [np.zeros(0)], 0
        while count < n:
            target = self.rng.uniform(0.1, 0.35) if self.x > 0.5 else self.rng.uniform(0.65, 0.9)
            speed = self.rng.uniform(0.15, 0.3) * (closing if target > self.x else 1.0)
            steps = max(round(abs(target - self.x) / speed / DT), 2)
            stroke = np.linspace(self.x, target, steps + 1)[1:]
            parts += [stroke, np.full(round(rest / DT), target)]
            self.x = target
            count = sum(map(len, parts))
        x = np.concatenate(parts)[:n]
        self.x = float(x[-1])
        return x

    def columns(
        self,
        x: np.ndarray,
        dK: float = 0.0,
        dF: float = 0.0,
        preload: float = 0.0,
        gain: float = 0.0,
        pressure: float = 0.0,
        dp_offset: float = 0.0,
        held: float = 0.0,
    ) -> tuple[np.ndarray, ...]:
        """Return stamp, x, ps, P1 - P2; `held`: force / FN that the resting stem bears more."""
        c, rng = self.c, self.rng
        t = self.t + np.arange(len(x)) * DT
        self.t += len(x) * DT
        v = np.gradient(x, DT)
        dp = 0.9e6 * (1.0 + 0.04 * np.sin(0.6 * t))
        stuck = held * np.where(np.abs(v) < 1e-6, np.sin(4.0 * t), 0.0)
        ps = chamber_pressure(c, x, v, dp, dK, dF, preload, stuck)
        x = x * (1.0 + gain) + 7e-4 * rng.standard_normal(len(x))
        ps = ps * (1.0 + pressure) + 80.0 * rng.standard_normal(len(x))
        stamp = np.round(t * 1e9).astype(np.int64)
        return stamp, x, ps, dp + dp_offset


def take(signature: Signature, columns, alarm: bool = False, ready: bool = True) -> np.ndarray:
    """Return what the step told of each sample."""
    s, c = signature.state[0], signature.record[0]
    results = np.full(len(columns[0]), QUIET)
    for i, (stamp, x, ps, dp) in enumerate(zip(*columns, strict=True)):
        results[i] = step(s, c, int(stamp), float(x), float(ps), float(dp), ready, alarm)
    return results
