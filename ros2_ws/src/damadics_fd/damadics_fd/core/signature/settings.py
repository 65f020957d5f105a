# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the valve signature."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

from damadics_fd.core.field import Section
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import CAUSES, NO_CLASSES, SIGN
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import RECOVERY

MIN_RATE = 40.0  # [Hz] fewer samples make no block mean
VALVE = Valve()  # the benchmark's


@dataclass(frozen=True)
class SignatureSettings(Section):
    """
    Settings of the valve signature of one actuator.

    The geometry describes the valve, the rest follows the rules in docs/signature.md.
    """

    DERIVED: ClassVar[tuple[str, ...]] = ('block_ns', 'min_samples', 'carried', 'weight_share')

    # geometry; defaults: DAMADICS actuator
    force_scale: float = VALVE.force_scale  # [N] FN = K L
    preload: float = VALVE.spring_origin  # [1] x1 = X + preload is 0 where the spring is relaxed
    weight: float = VALVE.mass * VALVE.gravity  # [N] m g
    diaphragm_area: float = VALVE.signed_area  # [m2] Ae, negative where the air opens
    plug_area: float = VALVE.signed_plug_area  # [m2] negative where the flow closes
    plug_km: tuple[float, ...] = RECOVERY  # [1] Km(X): plug force (P1 - P2) / Km * plug_area
    available: bool = True  # False: nothing is done
    sample_period: float = 0.005  # [s] nominal
    # blocks
    block: float = 0.1  # [s] Tb: a multiple of the periods of 50 Hz and 60 Hz
    range_gate: float = 0.03  # [1] end stops and the steep end of the plug table
    v_min: float = 0.02  # [1/s]
    v_max: float = 1.5  # [1/s]
    v_stribeck: float = 0.026  # [1/s] vs / L
    stribeck_weight: float = 40.0  # [1] ((fs - fc) / (FN sigma))^2
    # reference
    start: float = 5.0  # [s] the filters settle
    learn: float = 60.0  # [s]
    learn_blocks: int = 40  # moving blocks in each direction
    learn_weight: float = 80.0
    learn_range: float = 0.3  # [1]
    theta_nominal: tuple[float, float, float, float] = (1.0, 0.0, 0.0246, 0.0108)  # K b c Fc
    theta_std: tuple[float, float, float, float] = (0.10, 0.05, 0.02, 0.02)
    plug_gain_std: float = 0.03  # [1] prior of the error of the plug force, common part
    plug_shape_std: float = 0.01  # [1] and of each node of its table
    floor: tuple[float, float, float, float] = (0.001, 0.0005, 0.001, 0.0003)
    plug_floor: float = 0.0002
    lag_std: float = 0.05  # [s] prior of the lag between P1 - P2 and position
    stribeck_std: float = 0.01  # [1] prior of the friction that vanishes with speed
    ps_lag: float = 0.0  # [s] of the chamber pressure, to which position and P1 - P2 were delayed
    ps_lag_std: float = 0.0  # [s] how well the lag of the chamber pressure is known
    hysteresis: float = 0.0  # [1] of the learned dry friction, what is none
    hysteresis_std: float = 0.0  # [1] how well that is known
    size_weight: float = 5000.0  # blocks that the unit of a size rests on in the end
    sigma_min: float = 4e-4  # [1]
    # verification
    verify: float = 60.0  # [s]
    verify_blocks: int = 60  # moving blocks
    kappa_max: float = 3.0
    own_alarm: bool = True
    # evidence
    memory: tuple[float, float, float, float] = (6.0, 30.0, 300.0, 30.0)
    change_std: tuple[float, ...] = (0.5, 0.2, 1.0, 0.2, 0.3, 0.3, 0.3, 0.1)  # v s | h = 2..7
    growth_std: tuple[float, float] = (0.3, 1.0)  # friction, spring: change in 10 s
    prior: tuple[float, ...] = (1.0, 0.45, 0.45, 0.03, 0.03, 0.03, 0.03, 0.03)
    model_error: float = 0.2  # eps
    model_error_stage2: float = 0.03
    # decision
    d_decide: float = 30.0
    d_alarm: float = 40.0
    p_firm: float = 0.95
    n_firm: int = 3
    n_alarm: int = 3
    stage2_delay: float = 10.0  # [s]
    unconfirmed_after: float = 60.0  # [s]
    # material changes: smaller ones are reported without a maintenance level
    material_friction: float = 0.3
    material_spring: float = 0.02
    # supply pressure from the top speed
    supply_pressure: float = VALVE.supply_pressure  # [Pa]
    material_supply: float = 0.14  # [1] loss of supply pressure, as a share
    chamber_volume: float = VALVE.chamber_volume  # [m3] dead volume V0
    stroke: float = VALVE.stroke  # [m]
    # NAMUR NE 107 class of each of CAUSES
    ne107: tuple[float, ...] = NO_CLASSES

    @classmethod
    def of(cls, settings: Settings, classes: Sequence[int] = NO_CLASSES) -> Self:
        """
        Return the settings of the signature of an actuator.

        :param settings: of its estimator and detector.
        :param classes: NAMUR NE 107 class of each of CAUSES.
        :return: geometry and choices taken over, the rest by default.
        """
        c = settings
        return cls(
            force_scale=c.stiffness * c.stroke,
            preload=c.spring_origin,
            weight=c.mass * c.gravity,
            diaphragm_area=c.signed_area,
            plug_area=c.signed_plug_area,
            plug_km=c.plug_table,
            stroke=c.stroke,
            theta_nominal=(1.0, 0.0, c.alpha1 / c.alpha4, cls.theta_nominal[SIGN]),
            sample_period=1.0 / c.sample_rate,
            available=c.signature and c.sample_rate >= MIN_RATE,
            own_alarm=c.own_alarm,
            verify=c.verify,
            start=c.t_on,
            learn=c.t_learn,
            plug_gain_std=c.plug_gain_std,
            plug_shape_std=c.plug_shape_std,
            ps_lag=c.ps_lag,
            ps_lag_std=c.ps_lag_std,
            hysteresis=c.hysteresis / (c.stiffness * c.stroke),
            hysteresis_std=c.hysteresis_std / (c.stiffness * c.stroke),
            material_friction=c.material_friction,
            material_spring=c.material_spring,
            material_supply=c.material_supply,
            supply_pressure=c.supply_pressure,
            chamber_volume=c.chamber_volume,
            ne107=tuple(classes),
        )

    @property
    def block_ns(self) -> int:
        """Length of a block [ns]."""
        return round(self.block * 1e9)

    @property
    def min_samples(self) -> int:
        """Samples that make a block whole."""
        return max(1, math.ceil(0.75 * self.block / self.sample_period - 1e-9))

    @property
    def carried(self) -> float:
        """Share of a slip's variance that the delay carries into the next block."""
        return math.exp(-self.block / self.ps_lag) if self.ps_lag > 0.0 else 0.0

    @property
    def weight_share(self) -> float:
        """Weight / FN: a division less in each sample."""
        return self.weight / self.force_scale

    def problems(self) -> list[str]:
        """
        List what no valve can have.

        :return: one sentence per error; empty where all is well.
        """
        wrong = []
        if len(self.plug_km) != len(RECOVERY) or min(self.plug_km) <= 0.0:
            wrong.append(f'plug_km must have {len(RECOVERY)} positive entries')
        if len(self.ne107) != len(CAUSES):
            wrong.append(f'ne107 must have {len(CAUSES)} classes, got {len(self.ne107)}')
        if self.diaphragm_area == 0.0:
            wrong.append('diaphragm_area must not be 0')
        positive = {
            'force_scale': self.force_scale,
            'sample_period': self.sample_period,
            'block': self.block,
            'sigma_min': self.sigma_min,
        }
        wrong += [f'{k} must be positive, got {v}' for k, v in positive.items() if not v > 0.0]
        return wrong
