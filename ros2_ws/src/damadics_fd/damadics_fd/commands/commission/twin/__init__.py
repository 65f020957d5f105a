# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The twin of a valve: the constants with which the simulated actuator moves as it did."""
