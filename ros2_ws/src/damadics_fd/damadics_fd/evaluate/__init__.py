# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judge detectors with the indices of the DAMADICS benchmark definition."""
