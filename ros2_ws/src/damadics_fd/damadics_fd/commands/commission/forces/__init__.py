# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The balance of forces on the stem, as recordings tell it: spring, plug, friction, lag."""
