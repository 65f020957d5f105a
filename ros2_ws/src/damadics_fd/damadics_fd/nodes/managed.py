# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the monitoring nodes share: a lifecycle that starts by itself, parameters, diagnostics."""

import sys
from abc import ABC, abstractmethod
from pathlib import Path

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from damadics_fd.core.settings import Settings
from damadics_fd.core.text import NAME, plain
from damadics_fd.nodes.input_watch import InputWatch
from damadics_fd.ros.commissioned import commissioned
from damadics_fd.ros.diagnostics import Diagnostics, Level, Report
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.freshness import default_max_age
from damadics_fd.ros.parameter_files import files_of, says_nothing
from damadics_fd.ros.parameters import Parameters, declare_settings
from damadics_fd.ros.process import own_services
from damadics_fd.ros.process.rounds import Rounds
from damadics_fd.ros.spin import SpinnableNode, StartError
from damadics_fd.store.slots import check_folder

TIMEOUT_LIMITS = (0.01, 3600.0)
LATE = 1.0  # s that a sample may be behind or ahead of the clock without a word
DONE = TransitionCallbackReturn.SUCCESS


class MonitoringNode(LifecycleNode, SpinnableNode, ABC):
    """
    A lifecycle node with one watched input.

    What it publishes, takes and serves is made when it is configured and released when it is
    cleaned up. Inactive it takes no samples, and says so. `autostart` brings it to active.

    :param name: of the node.
    :param topic: of its input.
    :param command: that starts the publisher of the input.
    :param arguments: ROS arguments of this node alone; those of the process by default.
    """

    watch: InputWatch
    diagnostics: Diagnostics
    rounds: Rounds | None = None  # of the process, where other nodes share it

    def __init__(
        self, name: str, topic: str, command: str, arguments: list[str] | None = None
    ) -> None:
        super().__init__(name, cli_args=arguments, use_global_arguments=arguments is None)
        own_services.contain(self)
        self.finished = False
        self.exit_code = 0
        self.active = False
        self.entities = Entities(self, self.rounds)
        self._input = topic, command
        self._cause = ''  # why it could not be configured
        self.parameters = Parameters(self)
        declare = self.parameters.declare
        self.actuator = plain(declare('actuator', '', 'tag of the actuator'), NAME) or 'actuator'
        self._timeout = declare(
            'input_timeout',
            0.5,
            'silence after which the valve is not monitored [s]; three '
            'sample periods where that is longer',
            limits=TIMEOUT_LIMITS,
            live=True,
        )
        self._max_age = declare(
            'max_age',
            0.0,
            'age from which a judgement is not healthy any more, by the stamp of its measurement '
            '[s]; 0: the larger of 2 s and three sample periods',
            limits=(0.0, TIMEOUT_LIMITS[1]),
            live=True,
        )
        self._autostart = declare('autostart', True, 'configure and activate by itself')
        self.declare_more()
        self.settings: Settings = declare_settings(self.parameters)
        self.add_post_set_parameters_callback(self._apply)
        files = files_of(sys.argv if arguments is None else arguments)
        self.commissioned = commissioned(files)
        for file in files:
            if silent := says_nothing(file, self.get_fully_qualified_name()):
                self.get_logger().warning(silent)

    def declare_more(self) -> None:
        """Declare the parameters of the node itself."""

    @abstractmethod
    def make(self) -> None:
        """Make what the node publishes, takes and serves; begin afresh."""

    @abstractmethod
    def report(self) -> Report:
        """
        Say how the active node is.

        :return: level, one sentence, values by name.
        """

    def start(self) -> None:
        """
        Go through the lifecycle to active, if `autostart` says so; call it at the end.

        :raises StartError: with the cause, where that fails.
        """
        if self._autostart and (
            self.trigger_configure() != DONE or self.trigger_activate() != DONE
        ):
            raise StartError(f'{self.get_name()} does not start: {self._cause}')

    def check_folders(self, **folders: Path | None) -> None:
        """
        Refuse folders that cannot be written.

        :param folders: by the parameter that names each; None where nothing is kept.
        :raises StartError: naming each that cannot.
        """
        wrong = [
            f'{name}: {problem}'
            for name, folder in folders.items()
            if folder and (problem := check_folder(folder))
        ]
        if wrong:
            raise StartError('\n  '.join([f'{self.get_name()} cannot keep its files:', *wrong]))

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make what the node needs."""
        self.entities = Entities(self, self.rounds)
        try:
            period = 1.0 / self.settings.sample_rate
            self.watch = InputWatch(self, self.entities, *self._input, self._timeout, period)
            self.watch.max_age = self._max_age or default_max_age(period)
            self.diagnostics = Diagnostics(self, self.entities, self.actuator, self._report)
            self.make()
        except Exception as problem:  # rclpy would swallow it
            self._cause = f'{problem}' or type(problem).__name__
            self.get_logger().error(f'not configured: {self._cause}')
            self.entities.release()
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take samples from now on."""
        self.active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take no samples any more."""
        self.active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release what was made."""
        self.entities.release()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release what was made, for good."""
        self.active = False
        self.entities.release()
        return super().on_shutdown(state)

    def destroy_node(self) -> None:
        """Release the node; what is still queued for it does nothing."""
        self.entities.release()
        super().destroy_node()

    def refuse(self, cause: str) -> None:
        """
        End the node, as it does harm.

        :param cause: one sentence.
        """
        if not self.finished:
            self.get_logger().fatal(cause)
        self.exit_code = 1
        self.finished = True

    def _report(self) -> Report:
        level, message, values = self.report()
        watch = self.watch
        values = {'Mode': self.settings.mode, **values, **watch.values()}
        if not self.active:
            return Level.WARN, 'inactive: the lifecycle has not activated this node', values
        if self.entities.problem:
            return Level.ERROR, self.entities.problem, values
        if level == Level.ERROR:
            return level, message, values
        if watch.stale:
            return Level.ERROR, f'not monitored: {watch.lateness}', values
        if watch.problem:
            return Level.WARN, watch.problem, values
        if level == Level.OK and abs(watch.lag) > LATE:
            return Level.WARN, watch.lateness, values
        return level, message, values

    def _apply(self, changes: list[Parameter]) -> None:
        for change in changes:
            if change.name not in ('input_timeout', 'max_age') or not isinstance(
                change.value, float
            ):
                continue
            if change.name == 'input_timeout':
                before, self._timeout = self._timeout, change.value
            else:
                before, self._max_age = self._max_age, change.value
            self.get_logger().info(f'{change.name} changed from {before:g} to {change.value:g} s')
        if hasattr(self, 'watch'):
            self.watch.timeout = self._timeout
            self.watch.max_age = self._max_age or default_max_age(1.0 / self.settings.sample_rate)
