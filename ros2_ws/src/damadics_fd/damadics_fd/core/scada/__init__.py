# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Monitor a valve from the signals of a control room: CV, X, P1, P2, T1, F at 1 Hz."""
