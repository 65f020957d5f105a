# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Numbers and memory of the valve signature: columns, hypotheses, causes, state.

Units of the normalised model: position X = stem / stroke, forces in units of FN = K L
(stiffness times stroke), time in seconds.
"""

import math
from typing import Annotated

import numpy as np

from damadics_fd.core.record import Floats, Ints, Record

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
_SETS: Ints = np.arange(N_SETS)
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
RATE, PS, WHEN = range(3)  # what is kept of a stroke
SMALL_FRICTION = 1e-3  # [1] least friction that a share is taken of


class Clock(Record):
    """Time and the alarm outside, as the step takes them in."""

    t0: int  # [ns] stamp that blocks are counted from
    t: int  # [ns] newest stamp
    alarm_in: int  # 1 while there is an alarm, whoever raised it


class Phase(Record):
    """What the signature is doing."""

    state: int  # a STATE constant
    since: int  # [ns] of it
    n_moving: float  # moving blocks judged since then, sticky ones by their weight


class Blocks(Record):
    """The block under construction and the last three, the newest last."""

    index: int
    n: int
    sx: float
    su: float
    sp: float
    sg: float
    st: float
    sr: float
    srr: float
    srt: float
    stt: float
    late_x: float  # the newest position and its time
    late_t: float
    run: int  # whole blocks in a row
    slide: int  # moving blocks in a row
    bx: Annotated[Floats, 3]  # position
    bu: Annotated[Floats, 3]  # force / FN
    bp: Annotated[Floats, 3]  # chamber pressure, as a force / FN
    bdp: Annotated[Floats, 3]  # [Pa] P1 - P2
    bt: Annotated[Floats, 3]  # [s] since t0
    br: Annotated[Floats, 3]  # variance of the position about a straight motion
    noise: float  # what of it is noise: the lower quartile of all blocks


class Reference(Record):
    """The fault-free valve; with the rates of the air what a restarted node needs."""

    theta: Annotated[Floats, N_REF]
    J0: Annotated[Floats, N_REF, N_REF]  # information on theta
    sigma: float  # noise of a block
    r_ref: float  # stick range
    kappa: float  # by which the standard deviations were widened
    verified: int
    # K b c Fc for stating sizes, their covariance, the blocks they rest on
    unit: Annotated[Floats, TABLE]
    unit_cov: Annotated[Floats, TABLE, TABLE]
    unit_weight: float


class Learning(Record):
    """What the reference rests on so far."""

    n_learn: float
    n_up: int
    n_down: int
    x_low: float
    x_high: float


class Sums(Record):
    """Exponentially weighted sums over moving blocks."""

    S: Annotated[Floats, N_SETS, N_COL, N_COL]
    q: Annotated[Floats, N_SETS, N_COL]
    rr: Annotated[Floats, N_SETS]
    ne: Annotated[Floats, N_SETS]
    vb: Annotated[Floats, N_SETS]


class Evidence(Record):
    """The evidence of each set: D, log posteriors, changes, standard deviations."""

    D: Annotated[Floats, N_SETS]
    due: Annotated[Ints, N_SETS]
    over: Annotated[Ints, N_SETS]
    d_max: Annotated[Floats, N_SETS]
    logp: Annotated[Floats, N_SETS, N_HYP]
    value: Annotated[Floats, N_SETS, N_HYP]
    sd: Annotated[Floats, N_SETS, N_HYP]
    # friction: share of the dry part alone, and by how much it differs from that of all
    dry: Annotated[Floats, N_SETS]
    dry_sd: Annotated[Floats, N_SETS]
    apart: Annotated[Floats, N_SETS]
    apart_sd: Annotated[Floats, N_SETS]


class Sizes(Record):
    """Changes now: spring, preload, friction, estimated together over the slow set."""

    now: Annotated[Floats, 3]
    now_std: Annotated[Floats, 3]
    now_t: int


class Cues(Record):
    """The range of force that the standing stem has borne, and passivity."""

    stick: int
    stick_x: float
    stick_low: float
    stick_high: float
    r_max: float
    b_p_until: int


class OwnAlarm(Record):
    """The alarm as the signature sees it."""

    own: int  # 1 while its own alarm stands
    own_t: int  # [ns] it began
    alarm_t: int  # [ns] the present alarm began, whoever raised it
    n_alarm: float  # weight of the moving blocks since
    raised_by: float  # moving blocks whose evidence raised it
    without: float  # moving blocks without evidence in a row
    gone: int  # 1 after as many of those as had raised it


class Cause(Record):
    """The judgement of an alarm."""

    stage2: int
    run_f: int
    run_e: int
    family: int
    cause: int
    second: int
    cause_value: float
    cause_std: float
    confidence: float


class Air(Record):
    """Rates at which the chamber fills and vents: learned, and of the latest strokes."""

    air_learned: Annotated[Ints, 2]
    air_ref: Annotated[Floats, 2]
    air_ref_ps: Annotated[Floats, 2]  # [Pa] 0: not known
    air_way: int
    air_n: int
    air_moved: float
    air_top: float
    air_second: float
    air_ps: float
    air_count: Annotated[Ints, 2]
    air_ring: Annotated[Floats, 2, 3, STROKES]  # RATE, PS [Pa] and WHEN [ns] of the latest
    air_past: Annotated[Floats, 2, 3, STROKES]  # of those before them
    air_above: float  # [Pa] by which a loss counts from more than a slow one does
    air_law: Annotated[Floats, 2, 4]  # sums over pairs of strokes: number, dg2, dg dy, dy2
    air_last: Annotated[Floats, 2, 2]  # g and y of the last stroke, see `supply.note_law`
    air_last_t: Annotated[Ints, 2]  # [ns] 0: none
    air_rate: Annotated[Floats, 2]
    air_rate_ps: Annotated[Floats, 2]


class Block(Record):
    """The block under evaluation: scratch."""

    moving: int
    standing: int
    age: float  # by which it ages the memories: its weight where the stem sticks, else 1
    x: float
    u: float
    v: float
    w: float
    ph: Annotated[Floats, N_COL]


class Work(Record):
    """Matrices of the compiled functions: scratch."""

    # a stack of one matrix: numba types its members alike, whatever their size
    L: Annotated[Floats, 1, N_REF, N_REF]
    Y: Annotated[Floats, 1, N_REF, N_COL]
    y0: Annotated[Floats, N_REF]
    Gm: Annotated[Floats, 1, N_COL, N_COL]
    gv: Annotated[Floats, N_COL]
    H: Annotated[Floats, 1, N_FIT, N_FIT]
    W: Annotated[Floats, 1, N_FIT, N_FIT]
    d: Annotated[Floats, N_FIT]


class State(
    OwnAlarm, Cause, Clock, Phase, Blocks, Reference, Learning, Sums, Evidence, Sizes, Cues, Air
):
    """
    All that is remembered, each part written by one file; scratch in records of its own.

    What every sample needs stands first, side by side in the cache.
    """

    block: Block
    work: Work


SAVED = (*Reference.names(), 'air_learned', 'air_ref', 'air_ref_ps', 'air_law')


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
