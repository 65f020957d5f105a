# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from enum import Enum
from typing import NamedTuple

from rclpy.node import Node

class LifecycleState(NamedTuple):
    label: str
    state_id: int

class TransitionCallbackReturn(Enum):
    SUCCESS = 97
    FAILURE = 98
    ERROR = 99

class LifecycleNode(Node):
    def trigger_configure(self) -> TransitionCallbackReturn: ...
    def trigger_activate(self) -> TransitionCallbackReturn: ...
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn: ...
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn: ...
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn: ...
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn: ...
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn: ...
