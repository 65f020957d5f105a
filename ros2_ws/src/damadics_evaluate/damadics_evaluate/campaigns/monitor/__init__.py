# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What monitor mode achieves: false alarms, misses, delays, masking, other sample rates."""
