# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
