# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The faults that were induced in the plant of Lublin: schedule, files, detectors, table."""
