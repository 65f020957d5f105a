# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Labelled recordings of any plant: labels, indices with confidence intervals, the table."""
