# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Positioner and air path of the actuator: set-point filter, lever, E/P transducer, air flow."""

import math

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.valve.tables import interpolate

ATMOSPHERE = 101325.0  # Pa
GAS_CONSTANT = 287.0  # J/(kg K), of air
AIR_TEMPERATURE = 293.0  # K; the chamber is isothermal
TRANSDUCER_INPUT = np.array([-1, -0.94, -0.54, 0.46, 0.86, 1])
TRANSDUCER_OUTPUT = np.array([-0.55, -0.55, -0.02, 0.02, 1, 1])
"""Characteristic of the E/P transducer: a strongly asymmetric quasi dead zone."""


@jit
def set_point_filter(
    y1: float, y2: float, cv: float, q: float, decay: float
) -> tuple[float, float]:
    """
    Pass CV through the positioner's two equal lags for one step, exactly.

    :param y1: output of the first lag.
    :param y2: output of the second lag.
    :param cv: control value, constant over the step.
    :param q: step / lag.
    :param decay: exp(-q).
    :return: both outputs after the step.
    """
    u = min(max(cv, 0.0), 1.024)
    return u + (y1 - u) * decay, u + (y2 - u + q * (y1 - u)) * decay


@jit
def feedback_angle(x: float, stroke: float) -> float:
    """
    Convert the stem position to the lever angle the positioner sees.

    :param x: position [m], -0.01..0.05.
    :param stroke: of the stem, which is the length of the lever [m].
    :return: PV, 0 open, 1 closed.
    """
    sine = min(max((x - 0.5 * stroke) / stroke, -1.0), 1.0)
    return 0.5 + math.asin(sine) * (180.0 / math.pi) / 60.0


@jit
def characteristic(cvi: float) -> float:
    """
    Evaluate the E/P transducer.

    :param cvi: output of the positioner's controller, -1..1.
    :return: opening of the booster, -0.55..1; > 0 fills the chamber, < 0 vents it.
    """
    return interpolate(cvi, TRANSDUCER_INPUT, TRANSDUCER_OUTPUT)


@jit
def transducer(sp: float, pv: float, gain: float) -> float:
    """
    Evaluate the P controller of the positioner and the E/P transducer.

    :param sp: filtered set point.
    :param pv: measured position.
    :param gain: k_p.
    :return: opening of the booster, > 0 fills the chamber, < 0 vents it.
    """
    return characteristic(min(max(gain * (sp - pv), -1.0), 1.0))


@jit
def air_flow(opening: float, supply: float, ps: float, factor: float) -> float:
    """
    Evaluate the mass flow of air into the chamber.

    :param opening: output of the E/P transducer, -1..1.
    :param supply: supply pressure [Pa].
    :param ps: pressure of the chamber [Pa].
    :param factor: flow factor beta [kg/(s sqrt(Pa))].
    :return: mass flow [kg/s], > 0 into the chamber.
    """
    drop = (supply if opening > 0 else 0.0) - ps
    flow = factor * abs(opening) * math.sqrt(abs(drop))
    return flow if drop > 0 else -flow
