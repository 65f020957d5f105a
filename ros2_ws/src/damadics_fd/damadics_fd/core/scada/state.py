# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the SCADA-rate monitor keeps: the learned reference, the state, the last samples."""

from typing import Annotated

from damadics_fd.core.record import Floats, Ints, Record, Rows
from damadics_fd.core.scada.judging.cusum import TESTS
from damadics_fd.core.scada.judging.pressure import TAPS, PressureFilter
from damadics_fd.core.scada.laws.flow_law import FlowLaw
from damadics_fd.core.scada.laws.stem_law import StemLaw, StemTrack
from damadics_fd.core.scada.model import Faults, StemState

N_TESTS = len(TESTS)
N_WEIGHTS = 11
BASIC_WEIGHTS = 3  # constant, gain, CV slope; the others only where they earn their place
HISTORY_LENGTH = 1536
METER = 3  # last samples with a flow that the meter lags behind, the latest first
N_RESIDUALS = 6
N_ROUGH = 5  # of them, whose noise is followed: all but the process
FIRST_TRIAL, TRIALS = 2, 6  # models that run beside the two after a start
NOMINAL, LAW = range(2)  # where stem and flow come from: the stated actuator, what was identified


class History(Record):
    """Remember one sample, for the isolation."""

    t0: float
    t: float
    cv0: float
    cv: float
    dp0: float
    dp: float
    slope0: float
    slope: float
    x: float
    p1: float
    p2: float
    t1: float
    flow: float
    correction: float
    f: float
    sq: float
    r1: float
    r2: float
    xm: float
    stem: StemState
    masked: bool


class Reference(Record):
    """What was learned of a valve from fault-free records."""

    stem_kind: int  # NOMINAL or LAW
    flow_kind: int
    stem_law: StemLaw
    flow_law: FlowLaw
    period: float  # of the samples learned from, s
    regular: bool  # they came at it, one like the other
    longest_repeat: int  # rows in a row that were the row before
    signals: int  # bit i: signal i of the samples was measured
    low: Annotated[Floats, 7]  # learned range of each signal
    high: Annotated[Floats, 7]
    spike: Annotated[Floats, 5]  # change of CV, X, P1, P2, F that, taken back at once, is none
    seconds: float  # how long the record was
    drop: float  # P1 - P2
    flow_max: float
    swing: Annotated[Floats, 2]  # change of P1, P2 that no load change explains
    x_mean: float  # of the model, where r1 was learned
    x_sd: float
    f_mean: float  # of the flow, where r2 was learned
    f_sd: float
    f_sigma: float  # of F' - f there
    se: Annotated[Floats, N_TESTS]  # allowance that grows with the distance from there
    pressure: Annotated[Rows[PressureFilter], 2]
    hold: bool  # CV is held between samples
    cv_jump: float  # change of CV between two samples that was not learned
    air: float  # logarithm of the air with which the stated stem starts
    w: Annotated[Floats, N_WEIGHTS]
    dp_mean: float
    g0: float
    g1: float
    mu: Annotated[Floats, N_TESTS]
    sd: Annotated[Floats, N_TESTS]
    k: Annotated[Floats, N_TESTS]
    h: Annotated[Floats, N_TESTS]
    clip: Annotated[Floats, N_TESTS]
    rough: Annotated[Floats, N_ROUGH, 2]  # usual change from sample to sample, block to block
    wander: float  # by which a stem at rest was seen off its law for some seconds
    s1: float
    kap2: float
    llr_limit: float
    n: int


REFERENCE = Reference.dtype()


class MonitorState(Record):
    """Remember one valve between two samples."""

    samples: int
    t_first: float
    t: float
    t_raw: float  # last sample seen, accepted or thinned out
    t_test: float  # no test before
    t_stem: float  # no test of r1 before
    t_flow: float  # no test of r2 before
    t_lagged: Annotated[Floats, METER]  # when the flow that the meter lags behind was known
    blind: int  # samples in a row without a pressure
    filled: int  # pressure samples since the last restart
    past: Annotated[Floats, 2, TAPS]
    p_hat: Annotated[Floats, 2]
    steady: int  # samples in a row at the period
    strange: int  # samples in a row at another period than the learned one
    innovation: Annotated[Floats, 2]  # of P1, P2; NaN until as many as taps are steady
    stem: Annotated[Rows[StemState], FIRST_TRIAL + TRIALS]  # nominal, wide play, others' air
    air: float  # logarithm of the air that was found at the start, see judging/air.py
    air_looks: int  # that were taken at it
    air_count: int  # samples since the last one
    air_nats: float  # by which the air that was found is likelier than none
    air_fit: Annotated[Floats, TRIALS + 1, 3]  # sums over them, see judging/air.py
    air_x: Annotated[Floats, TRIALS]  # scratch
    track: StemTrack
    xs: float  # slow copy of the stem law
    xq: float  # quick copy
    last: Annotated[Floats, 4, 5]  # CV, X, P1, P2, F of this sample and the three before
    repeats: int  # samples in a row that are the one before
    size: float
    f_lagged: Annotated[Floats, METER]
    f_slow: Annotated[Floats, METER]  # the same behind a meter as slow as meters are
    top_flow: float  # largest so far, and how often: a meter at its end shows it again and again
    top_count: int
    drift: Annotated[Floats, 2]  # of stem (share of stroke) and flow (log) since learning
    level: Annotated[Floats, 2]  # where P1, P2 have been lately
    level_before: Annotated[Floats, 2]  # the same before the present occurrence
    level_flow: float
    t_stop: float  # the stem was at an end until then
    testable: Annotated[Ints, N_RESIDUALS]
    stands: Annotated[Ints, N_RESIDUALS]  # a fault seen in it and not seen to be gone
    good: Annotated[Ints, N_RESIDUALS]  # testable samples in a row without evidence
    inside: int  # the stem is where it was learned
    travel: float  # of the model since the last evidence in r1
    away: Annotated[Floats, 2]  # from where r1, r2 were learned, in its standard deviations
    lever: Annotated[Floats, 2]  # standard error there over that in the middle
    air_doubt: float  # what the air that was found adds to that of r1
    saved: Annotated[Floats, N_TESTS, 2]  # statistics before a jump that may be a spike
    saved_llr: float
    jumped: Annotated[Ints, N_RESIDUALS]
    far_before: Annotated[Floats, N_RESIDUALS]  # how far the last one was, sigma
    spikes: Annotated[Ints, N_RESIDUALS]
    thrown: int  # samples for which r1 may still wait for the model after a wrong CV
    wrong: float  # single wrong samples of any signal lately
    process: int  # which pressures were far from their level which way, as bits
    doubtful: Annotated[Ints, 2]  # whether the last P1, P2 was far and not, or yet, believed
    instead: Annotated[Floats, 2, TAPS]  # what was past if the last two were wrong
    occurrence: int
    t_raised: float  # of the present occurrence; t_alarm is the first one's
    stood: bool
    recovery: int  # samples without evidence after which a fault has gone
    t_gone: float
    t_shown: Annotated[Floats, N_RESIDUALS]  # when each residual showed it first; NaN: not yet
    sign: Annotated[Floats, N_RESIDUALS]  # and which way
    t_evidence: float  # last sample with evidence of it
    fault: Annotated[Rows[Faults], 2]
    cv: Annotated[Floats, 4]
    dp: Annotated[Floats, 2]  # z(k), z(k-1)
    xm: Annotated[Floats, 3]
    xd: float
    phi: Annotated[Floats, N_WEIGHTS]
    f: float
    f_model: float  # the same with the model's position
    sq: float
    masked: bool
    residual: Annotated[Floats, N_RESIDUALS]
    rough: Annotated[Floats, N_ROUGH, 2]  # lately, as learned in the reference
    rough_last: Annotated[Floats, N_ROUGH, 2]
    rough_count: Annotated[Ints, N_ROUGH, 2]
    rough_sum: Annotated[Floats, N_ROUGH]  # of the block that is not full
    rough_size: Annotated[Ints, N_ROUGH]
    g: Annotated[Floats, N_TESTS, 2]
    zero: Annotated[Floats, N_TESTS, 2]  # when g was last zero: estimate of the onset
    # since then: samples, sum of `away`, standard errors of the sum that the latter cost
    stretch: Annotated[Floats, N_TESTS, 2, 3]
    anchor: float  # where the stem moved to last, and samples since then
    rest: int
    lasting: float  # of r1 of a law, no evidence where it lasts
    llr: float
    llr_before: float  # the same before the present slip
    llr_zero: float
    ratio: float  # largest statistic / limit
    worst: int
    alarm: bool
    t_alarm: float
    t_onset: float
    test: int
    beyond: Annotated[Ints, N_TESTS]  # this sample speaks for a fault
    ratios: Annotated[Floats, N_TESTS + 1]
    peaks: Annotated[Floats, N_TESTS + 1]  # largest of the ratios so far
    history: Annotated[Rows[History], HISTORY_LENGTH]


MONITOR = MonitorState.dtype()
