# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the simulated plant names its signals, as a control system does."""

TAGS = {  # signal: end of its name, unit, factor from SI
    'cv': ('MV', 100.0),
    'x1': ('PV', 100.0),
    'p1': ('P1', 1e-5),
    'p2': ('P2', 1e-5),
    't1': ('T1', 1.0),
    'flow': ('FLOW', 3.6),
    'ps': ('PS', 1e-5),
}
