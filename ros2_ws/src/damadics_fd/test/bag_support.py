# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tests of recordings share."""

import numpy as np
import pytest
from damadics_fd.bag import BagError
from damadics_fd.bag.definition import type_hash

MEASUREMENT = 'damadics_msgs/msg/Measurement'
FAULT_STATE = 'damadics_msgs/msg/FaultState'
SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow')


def built() -> bool:
    """Tell whether the messages are installed."""
    try:
        return bool(type_hash(MEASUREMENT))
    except BagError:
        return False


needs_messages = pytest.mark.skipif(
    not built(), reason='damadics_msgs is not built: run make build and source env.sh'
)


def simulated(n: int = 4000) -> dict[str, np.ndarray]:
    """Return columns like those of the simulator, all values different."""
    t = np.arange(n) * 2_500_000
    rng = np.random.default_rng(1)
    return {
        'stamp': t + 5_999_999_999, **{name: rng.random(n) for name in SIGNALS},
        'fault': np.where(t > 3_000_000_000, 4, 0), 'strength': rng.random(n),
    }
