# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns over the scenarios of the benchmark: units of work, results, tables."""
