# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Numbers and memory of the valve signature: settings, state, enumerations.

Units of the normalised model: position X = stem / stroke, forces in units of FN = K L
(stiffness times stroke), time in seconds.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.settings import Settings
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import RECOVERY

# -- regressor of one block -----------------------------------------------------------------
N_TABLE = 11  # nodes 0, 0.1 .. 1 of the correction of the plug force table
X1, ONE, V, SIGN = 0, 1, 2, 3  # stiffness, preload, viscous friction, dry friction
TABLE = 4  # first of the plug force corrections
LAG = TABLE + N_TABLE  # time by which the stem feels P1 - P2 earlier than it is measured
STRIBECK = LAG + 1  # more dry friction at low speed
N_REF = STRIBECK + 1  # columns of the reference model
PB, G, POS, POSX = N_REF, N_REF + 1, N_REF + 2, N_REF + 3
SIGN_T, X1_T = N_REF + 4, N_REF + 5  # the same as SIGN and X1, growing with time
N_COL = N_REF + 6
N_FIT = 4  # columns that one hypothesis fits at most

# -- accumulators ---------------------------------------------------------------------------
N_SETS = 5
# of numpy: numba would compile a function anew for each literal int that it is given
_SETS: Any = np.arange(N_SETS)
SET_FAST, SET_MID, SET_SLOW, SET_ALARM, SET_UNIT = _SETS

# -- hypotheses -----------------------------------------------------------------------------
N_HYP = 8
NONE, FRICTION, SPRING, PRELOAD = range(4)
POSITION_GAIN, PRESSURE_GAIN, DP_OFFSET, POSITION_OFFSET = range(4, N_HYP)

# -- states of the signature, damadics_msgs/Signature ----------------------------------------
STATE_UNAVAILABLE, STATE_LEARN, STATE_INSUFFICIENT, STATE_VERIFY = 0, 1, 2, 3
STATE_MONITOR, STATE_ALARM = 4, 5

# -- families of causes ---------------------------------------------------------------------
FAMILY_UNDETERMINED, FAMILY_FRICTION, FAMILY_ELASTIC, FAMILY_UNCONFIRMED, FAMILY_SUPPLY = range(5)

# -- causes: what a person is told ------------------------------------------------------------
CAUSES = (
    'none',
    'undetermined',
    'unconfirmed',
    'friction_up',
    'friction_down',
    'stick_play',
    'elastic',
    'spring_stiffer',
    'spring_softer',
    'preload',
    'position_gain',
    'pressure_gain',
    'dp_offset',
    'position_offset',
    'supply',
)
(
    CAUSE_NONE,
    CAUSE_UNDETERMINED,
    CAUSE_UNCONFIRMED,
    CAUSE_FRICTION_UP,
    CAUSE_FRICTION_DOWN,
    CAUSE_STICK_PLAY,
    CAUSE_ELASTIC,
    CAUSE_SPRING_STIFFER,
    CAUSE_SPRING_SOFTER,
    CAUSE_PRELOAD,
    CAUSE_POSITION_GAIN,
    CAUSE_PRESSURE_GAIN,
    CAUSE_DP_OFFSET,
    CAUSE_POSITION_OFFSET,
    CAUSE_SUPPLY,
) = range(len(CAUSES))

NO_CLASSES = (0,) * len(CAUSES)

FILL, VENT = 0, 1  # ways of the chamber's air
STROKES = 5  # strokes each way that show the top rate

MIN_RATE = 40.0  # [Hz] fewer samples make no block mean
VALVE = Valve()  # the benchmark's


@dataclass(frozen=True)
class SignatureSettings:
    """
    Settings of the valve signature of one actuator.

    The geometry describes the valve, the rest follows the rules in docs/signature.md.
    """

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
    ps_lag_std: float = 0.0  # [s] how well the lag of the chamber pressure is known
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
    material_supply: float = 0.1  # [1] loss of the top filling rate
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
            ps_lag_std=c.ps_lag_std,
            material_friction=c.material_friction,
            material_spring=c.material_spring,
            material_supply=c.material_supply,
            supply_pressure=c.supply_pressure,
            chamber_volume=c.chamber_volume,
            ne107=tuple(classes),
        )

    def __post_init__(self) -> None:
        """Refuse settings that no valve can have."""
        if len(self.plug_km) != len(RECOVERY) or min(self.plug_km) <= 0.0:
            raise ValueError(f'plug_km must have {len(RECOVERY)} positive entries')
        if len(self.ne107) != len(CAUSES):
            raise ValueError(f'ne107 must have {len(CAUSES)} classes, got {len(self.ne107)}')
        if self.diaphragm_area == 0.0:
            raise ValueError('diaphragm_area must not be 0')
        for name in ('force_scale', 'sample_period', 'block', 'sigma_min'):
            if not getattr(self, name) > 0.0:
                raise ValueError(f'{name} must be positive, got {getattr(self, name)}')


def _record(pairs: list[Any]) -> np.dtype:
    return np.dtype((np.record, pairs))


def _settings_dtype() -> np.dtype:
    scalar = {float: 'f8', int: 'i8', bool: 'i8'}
    spec: list[Any] = [
        ('block_ns', 'i8'),
        ('min_samples', 'i8'),
    ]
    default = SignatureSettings()
    for field in fields(SignatureSettings):
        value = getattr(default, field.name)
        if isinstance(value, tuple):
            spec.append((field.name, 'f8', (len(value),)))
        else:
            spec.append((field.name, scalar[type(value)]))
    return _record(spec)


SETTINGS_DTYPE = _settings_dtype()


def settings_record(settings: SignatureSettings) -> NDArray[np.void]:
    """
    Return the settings as the structured array that the compiled step reads.

    :param settings: of one actuator.
    :return: array of length 1.
    """
    array = np.zeros(1, SETTINGS_DTYPE)
    for field in fields(settings):
        array[field.name][0] = getattr(settings, field.name)
    array['block_ns'] = round(settings.block * 1e9)
    expected = settings.block / settings.sample_period
    array['min_samples'] = max(1, int(np.ceil(0.75 * expected - 1e-9)))
    return array


# What a restarted node needs to go straight to MONITOR.
REFERENCE_FIELDS: list[Any] = [
    ('theta', 'f8', (N_REF,)),
    ('J0', 'f8', (N_REF, N_REF)),
    ('sigma', 'f8'),
    ('r_ref', 'f8'),
    ('kappa', 'f8'),
    ('verified', 'i8'),
    # K b c Fc for stating sizes, their covariance, the blocks they rest on
    ('unit', 'f8', (TABLE,)),
    ('unit_cov', 'f8', (TABLE, TABLE)),
    ('unit_weight', 'f8'),
    ('air_learned', 'i8', (2,)),
    ('air_ref', 'f8', (2,)),
    ('air_ref_ps', 'f8', (2,)),  # [Pa] 0: not known
]
REFERENCE_DTYPE = _record(REFERENCE_FIELDS)

STATE_DTYPE = _record(
    REFERENCE_FIELDS
    + [
        ('state', 'i8'),
        ('t0', 'i8'),
        ('t', 'i8'),
        ('since', 'i8'),
        # block under construction
        ('index', 'i8'),
        ('n', 'i8'),
        ('sx', 'f8'),
        ('su', 'f8'),
        ('sp', 'f8'),
        ('sg', 'f8'),
        ('st', 'f8'),
        # the last three blocks, newest last
        ('run', 'i8'),
        ('bx', 'f8', (3,)),
        ('bu', 'f8', (3,)),
        ('bp', 'f8', (3,)),
        ('bdp', 'f8', (3,)),
        ('bt', 'f8', (3,)),
        # block under evaluation
        ('moving', 'i8'),
        ('standing', 'i8'),
        ('slide', 'i8'),
        ('x', 'f8'),
        ('u', 'f8'),
        ('v', 'f8'),
        ('w', 'f8'),
        ('ph', 'f8', (N_COL,)),
        # LEARN
        ('n_learn', 'f8'),
        ('n_up', 'i8'),
        ('n_down', 'i8'),
        ('x_low', 'f8'),
        ('x_high', 'f8'),
        ('n_moving', 'i8'),
        # accumulators
        ('S', 'f8', (N_SETS, N_COL, N_COL)),
        ('q', 'f8', (N_SETS, N_COL)),
        ('rr', 'f8', (N_SETS,)),
        ('ne', 'f8', (N_SETS,)),
        ('vb', 'f8', (N_SETS,)),
        # evidence of each set: D, log posteriors, changes, standard deviations
        ('D', 'f8', (N_SETS,)),
        ('due', 'i8', (N_SETS,)),
        ('over', 'i8', (N_SETS,)),
        ('logp', 'f8', (N_SETS, N_HYP)),
        ('value', 'f8', (N_SETS, N_HYP)),
        ('sd', 'f8', (N_SETS, N_HYP)),
        # friction: share of the dry part alone, and by how much it differs from that of all
        ('dry', 'f8', (N_SETS,)),
        ('dry_sd', 'f8', (N_SETS,)),
        ('apart', 'f8', (N_SETS,)),
        ('apart_sd', 'f8', (N_SETS,)),
        ('d_max', 'f8', (N_SETS,)),
        # cues
        ('stick', 'i8'),
        ('stick_x', 'f8'),
        ('stick_low', 'f8'),
        ('stick_high', 'f8'),
        ('r_max', 'f8'),
        ('b_p_until', 'i8'),
        # alarm and decision
        ('alarm_in', 'i8'),
        ('own', 'i8'),
        ('alarm_t', 'i8'),
        ('own_t', 'i8'),
        ('stage2', 'i8'),
        ('n_alarm', 'f8'),
        ('run_f', 'i8'),
        ('run_e', 'i8'),
        ('family', 'i8'),
        ('cause', 'i8'),
        ('second', 'i8'),
        ('cause_value', 'f8'),
        ('cause_std', 'f8'),
        ('confidence', 'f8'),
        # changes now: spring, preload, friction (joint estimate over the slow set)
        ('now', 'f8', (3,)),
        ('now_std', 'f8', (3,)),
        ('now_t', 'i8'),
        # air supply
        ('air_way', 'i8'),
        ('air_n', 'i8'),
        ('air_moved', 'f8'),
        ('air_top', 'f8'),
        ('air_second', 'f8'),
        ('air_ps', 'f8'),
        ('air_count', 'i8', (2,)),
        ('air_ring', 'f8', (2, STROKES)),
        ('air_ring_ps', 'f8', (2, STROKES)),
        ('air_rate', 'f8', (2,)),
        ('air_rate_ps', 'f8', (2,)),
        # work space of the compiled functions
        # a stack of one matrix: numba types its members alike, whatever their size
        ('L', 'f8', (1, N_REF, N_REF)),
        ('Y', 'f8', (1, N_REF, N_COL)),
        ('y0', 'f8', (N_REF,)),
        ('Gm', 'f8', (1, N_COL, N_COL)),
        ('gv', 'f8', (N_COL,)),
        ('H', 'f8', (1, N_FIT, N_FIT)),
        ('W', 'f8', (1, N_FIT, N_FIT)),
        ('d', 'f8', (N_FIT,)),
    ]
)


def known(value: float, std: float, confidence: float) -> tuple[float, float, float]:
    """
    Put NaN in place of what is not known, which the state keeps as 0.

    :param value: change in the unit of the cause.
    :param std: its standard deviation.
    :param confidence: probability of the cause.
    :return: the three.
    """
    if confidence <= 0.0:
        return math.nan, math.nan, math.nan
    return float(value), float(std) if std > 0.0 else math.nan, float(confidence)
