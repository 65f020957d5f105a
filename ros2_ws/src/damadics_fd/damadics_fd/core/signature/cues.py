# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Physical cues: what only friction, and what friction never can do."""

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.blocks import table_force
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import ONE, SIGN, X1, Cues, State

B_MAX = 16.0  # enough to decide alone, unless the moving stem contradicts
EPISODE = 0.004  # [1] a standing stem may creep this far
PASSIVITY_WINDOW = 1_000_000_000  # [ns] after the alarm
PASSIVITY_HOLD = 10_000_000_000  # [ns]


@jit
def track_stick(s: State) -> None:
    """
    Widen the range of force that the standing stem has borne.

    Static friction bounds it by 2 Fs; a spring does not widen it.

    :param s: state record.
    """
    if s.block.standing == 0:
        s.stick = 0
        return
    e = s.block.u - s.block.x
    if s.stick == 0 or abs(s.block.x - s.stick_x) > EPISODE:
        s.stick = 1
        s.stick_x = s.block.x
        s.stick_low = e
        s.stick_high = e
    s.stick_low = min(s.stick_low, e)
    s.stick_high = max(s.stick_high, e)
    s.r_max = max(s.r_max, s.stick_high - s.stick_low)


@jit
def restart_range(s: Cues) -> None:
    """
    Look at the stick range anew.

    :param s: state record.
    """
    s.r_max = 0.0


@jit
def forget_stick(s: Cues) -> None:
    """
    Look at the stick range anew, of a stem that comes to rest anew.

    :param s: state record.
    """
    s.r_max = 0.0
    s.stick = 0


@jit
def restart_cues(s: Cues, t: int) -> None:
    """
    Look for cues on an alarm that begins.

    :param s: state record.
    :param t: [ns] now.
    """
    forget_stick(s)
    s.b_p_until = t


@jit
def shift_cues(s: Cues, shift: int) -> None:
    """
    Follow a clock that was set back.

    :param s: state record.
    :param shift: [ns] new time minus old time.
    """
    s.b_p_until += shift


@jit
def stick_evidence(s: State) -> float:
    """
    Return the log evidence of the stick range for friction.

    :param s: state record.
    :return: b_R, 0..16.
    """
    b_r: float = max(0.0, min(B_MAX, 6.0 * (s.r_max / s.r_ref - 1.8)))
    return b_r


@jit
def check_passivity(s: State, c: SignatureSettings) -> None:
    """
    Note a stem that moved against its force residual: friction cannot do that.

    :param s: state record; the newest block is read.
    :param c: settings record.
    """
    if s.t - s.alarm_t > PASSIVITY_WINDOW:
        return
    x = s.bx[2]
    rn = s.bu[2] - s.theta[X1] * (x + c.preload) - s.theta[ONE] - table_force(s, c, x, s.bdp[2])
    dx = x - s.bx[0]
    if rn * dx < 0.0 and abs(dx) > 0.008 and abs(rn) > 3.0 * s.theta[SIGN] + 0.02:
        s.b_p_until = s.t + PASSIVITY_HOLD
