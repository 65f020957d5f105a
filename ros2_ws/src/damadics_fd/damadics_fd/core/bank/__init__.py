# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Monitors of many valves in arrays, one compiled loop over their samples: see `bank.Bank`.

Nothing is imported here: a node of one valve takes `pair` only, and needs no mode scada for it.
"""
