# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the executables with a ROS 2 node begin."""

from damadics_fd.start import run


def opcua() -> int:
    """Run the connector to OPC UA."""
    return run('damadics_connect.opcua.command')


def mqtt() -> int:
    """Run the connector to MQTT."""
    return run('damadics_connect.mqtt.command')


def http() -> int:
    """Run the connector to HTTP."""
    return run('damadics_connect.http.command')


def notify() -> int:
    """Run the notifier."""
    return run('damadics_connect.notify.command')


def files() -> int:
    """Run the follower of files."""
    return run('damadics_connect.files.command')
