# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the project uses of rclpy, typed: rclpy itself is typed in part only."""

from rclpy import signals as signals
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions as SignalHandlerOptions

def init(
    *,
    args: list[str] | None = None,
    context: Context | None = None,
    domain_id: int | None = None,
    signal_handler_options: SignalHandlerOptions | None = None,
) -> None: ...
def ok(*, context: Context | None = None) -> bool: ...
def try_shutdown(
    *, context: Context | None = None, uninstall_handlers: bool | None = None
) -> None: ...
def create_node(
    node_name: str,
    *,
    context: Context | None = None,
    namespace: str | None = None,
    enable_rosout: bool = True,
) -> Node: ...
