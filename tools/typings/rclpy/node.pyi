# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable, Iterator, Mapping
from typing import Generic, Protocol, TypeVar

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.client import Client
from rclpy.clock import Clock
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

M = TypeVar('M')
Request = TypeVar('Request')
Response = TypeVar('Response')

class ServiceType(Protocol):
    """A type of service: it makes its own requests."""

    @property
    def Request(self) -> Callable[..., object]: ...

class NodeHandle:
    @property
    def pointer(self) -> int: ...
    def get_count_publishers(self, topic_name: str) -> int: ...
    def __enter__(self) -> NodeHandle: ...
    def __exit__(self, *error: object) -> None: ...

class Declared(Generic[M]):
    """A parameter, of the type of its default."""

    @property
    def value(self) -> M: ...

class TopicEndpointInfo:
    node_name: str
    node_namespace: str
    topic_type: str
    endpoint_gid: list[int]
    qos_profile: QoSProfile

class Node:
    _parameter_overrides: Mapping[str, Parameter]
    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        cli_args: list[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
    ) -> None: ...
    @property
    def publishers(self) -> Iterator[Publisher]: ...
    @property
    def services(self) -> Iterator[Service]: ...
    @property
    def timers(self) -> Iterator[Timer]: ...
    @property
    def context(self) -> Context: ...
    @property
    def handle(self) -> NodeHandle: ...
    def get_name(self) -> str: ...
    def get_namespace(self) -> str: ...
    def get_fully_qualified_name(self) -> str: ...
    def get_clock(self) -> Clock: ...
    def get_logger(self) -> RcutilsLogger: ...
    def get_parameter(self, name: str) -> Parameter: ...
    def declare_parameter(
        self, name: str, value: M, descriptor: ParameterDescriptor | None = None
    ) -> Declared[M]: ...
    def add_post_set_parameters_callback(
        self, callback: Callable[[list[Parameter]], None]
    ) -> None: ...
    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str: ...
    def create_publisher(
        self,
        msg_type: type[M],
        topic: str,
        qos_profile: QoSProfile | int,
    ) -> Publisher: ...
    def create_subscription(
        self,
        msg_type: type[M],
        topic: str,
        callback: Callable[[M], None],
        qos_profile: QoSProfile | int,
        *,
        event_callbacks: SubscriptionEventCallbacks | None = None,
        raw: bool = False,
    ) -> Subscription: ...
    def create_client(
        self, srv_type: ServiceType, srv_name: str, *, qos_profile: QoSProfile = ...
    ) -> Client: ...
    def create_service(
        self,
        srv_type: type[M],
        srv_name: str,
        callback: Callable[[Request, Response], Response],
        *,
        qos_profile: QoSProfile = ...,
    ) -> Service: ...
    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], object],
        callback_group: None = None,
        clock: Clock | None = None,
    ) -> Timer: ...
    def destroy_publisher(self, publisher: Publisher) -> bool: ...
    def destroy_subscription(self, subscription: Subscription) -> bool: ...
    def destroy_service(self, service: Service) -> bool: ...
    def destroy_timer(self, timer: Timer) -> bool: ...
    def destroy_node(self) -> None: ...
    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]: ...
    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]: ...
    def count_publishers(self, topic_name: str) -> int: ...
    def count_subscribers(self, topic_name: str) -> int: ...
    def get_publishers_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]: ...
