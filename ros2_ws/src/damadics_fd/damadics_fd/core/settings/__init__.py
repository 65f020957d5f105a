# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the estimator and the detector, each with unit, range, description and readers."""

from damadics_fd.core.field import SettingsError
from damadics_fd.core.settings.approximation import THRESHOLDS, VELOCITIES
from damadics_fd.core.settings.settings import Settings, unread

__all__ = ['THRESHOLDS', 'VELOCITIES', 'Settings', 'SettingsError', 'unread']
