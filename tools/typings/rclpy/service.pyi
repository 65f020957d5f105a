# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable

from lifecycle_msgs.srv import ChangeState

class Service:
    # Of any kind of request and response; those of the lifecycle stand for all.
    callback: Callable[[ChangeState.Request, ChangeState.Response], ChangeState.Response]
    srv_name: str
