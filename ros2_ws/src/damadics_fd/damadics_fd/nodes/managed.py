# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the monitoring nodes share: a lifecycle that starts by itself, parameters, diagnostics."""

from abc import ABC, abstractmethod

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from damadics_fd.core.settings import Settings
from damadics_fd.nodes.input_watch import InputWatch
from damadics_fd.ros.diagnostics import Diagnostics, Level, Report
from damadics_fd.ros.parameters import Parameters, declare_settings

TIMEOUT_LIMITS = (0.01, 3600.0)


class MonitoringNode(LifecycleNode, ABC):
    """
    A lifecycle node with one watched input.

    Inactive it takes no samples, and says so. `autostart` brings it to active when it starts.

    :param name: of the node.
    :param topic: of its input.
    :param command: that starts the publisher of the input.
    :param arguments: ROS arguments of this node alone; those of the process by default.
    """

    def __init__(
        self, name: str, topic: str, command: str, arguments: list[str] | None = None
    ) -> None:
        super().__init__(name, cli_args=arguments, use_global_arguments=arguments is None)
        self.finished = False
        self.exit_code = 0
        self.active = False
        self.parameters = Parameters(self)
        declare = self.parameters.declare
        self.actuator = declare('actuator', '', 'tag of the actuator') or 'actuator'
        timeout = declare(
            'input_timeout',
            0.5,
            'silence after which the valve is not monitored [s]; three '
            'sample periods where that is longer',
            limits=TIMEOUT_LIMITS,
            live=True,
        )
        self._autostart = declare('autostart', True, 'configure and activate by itself')
        self.declare_more()
        self.settings: Settings = declare_settings(self.parameters)
        self.watch = InputWatch(self, topic, command, timeout, 1.0 / self.settings.sample_rate)
        self.diagnostics = Diagnostics(self, self.actuator, self._report)
        self.add_post_set_parameters_callback(self._apply)

    def declare_more(self) -> None:
        """Declare the parameters of the node itself."""

    @abstractmethod
    def report(self) -> Report:
        """
        Say how the active node is.

        :return: level, one sentence, values by name.
        """

    def start(self) -> None:
        """Go through the lifecycle to active, if `autostart` says so; call it at the end."""
        if self._autostart:
            self.trigger_configure()
            self.trigger_activate()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take samples from now on."""
        self.active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take no samples any more."""
        self.active = False
        return super().on_deactivate(state)

    def refuse(self, cause: str) -> None:
        """
        End the node, as it does harm.

        :param cause: one sentence.
        """
        self.get_logger().fatal(cause)
        self.exit_code = 1
        self.finished = True

    def _report(self) -> Report:
        level, message, values = self.report()
        values = {'Mode': self.settings.mode, **values, **self.watch.values()}
        if not self.active:
            return Level.WARN, 'inactive: the lifecycle has not activated this node', values
        if self.watch.problem and level < Level.ERROR:
            return Level.WARN, self.watch.problem, values
        return level, message, values

    def _apply(self, changes: list[Parameter]) -> None:
        for change in changes:
            if change.name == 'input_timeout':
                self.get_logger().info(
                    f'input_timeout changed from {self.watch.timeout:g} to {change.value:g} s'
                )
                self.watch.timeout = change.value
