# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The air: strokes at full opening, and what supply pressure they show."""
