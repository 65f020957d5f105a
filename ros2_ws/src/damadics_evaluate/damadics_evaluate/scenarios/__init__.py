# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a campaign runs: cases, their zones, the plant's answer to them."""
