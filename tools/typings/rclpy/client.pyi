# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from typing import Protocol

from rclpy.task import Future

class Answer(Protocol):
    """What every service of the project answers."""

    success: bool
    message: str

class Client:
    def call_async(self, request: object) -> Future[Answer]: ...
    def service_is_ready(self) -> bool: ...
    def wait_for_service(self, timeout_sec: float | None = None) -> bool: ...
