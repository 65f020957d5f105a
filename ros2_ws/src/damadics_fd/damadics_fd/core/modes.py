# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Modes of the estimator and its phases, numbered as in damadics_msgs/Estimate."""

MODES = ('paper', 'monitor', 'scada')
PAPER, MONITOR, SCADA = range(3)

PHASES = ('init', 'learn_alpha', 'learn_phi', 'monitor', 'paper', 'hold')
PHASE_INIT, PHASE_LEARN_ALPHA, PHASE_LEARN_PHI, PHASE_MONITOR, PHASE_PAPER, PHASE_HOLD = range(6)
