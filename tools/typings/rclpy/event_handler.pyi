# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable

from rclpy.qos import QoSPolicyKind

class QoSMessageLostInfo:
    total_count: int
    total_count_change: int

class QoSRequestedIncompatibleQoSInfo:
    total_count: int
    total_count_change: int
    last_policy_kind: QoSPolicyKind

class SubscriptionEventCallbacks:
    def __init__(
        self,
        *,
        incompatible_qos: Callable[[QoSRequestedIncompatibleQoSInfo], None] | None = None,
        message_lost: Callable[[QoSMessageLostInfo], None] | None = None,
        use_default_callbacks: bool = True,
    ) -> None: ...
