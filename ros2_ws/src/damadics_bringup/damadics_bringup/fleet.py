# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the valves of a plant are parted: among processes, into real and simulated ones."""

from damadics_fd.store.fleet_file import Valve

MONITORS = ('estimator', 'detector')  # nodes of every valve


def simulated(valves: list[Valve]) -> list[Valve]:
    """
    Choose the valves that get a simulated plant: the others have a driver of their own.

    :param valves: the fleet.
    :return: those with an entry `simulate`; all where none has one.
    """
    return [valve for valve in valves if valve.simulate] or valves


def spread(valves: list[Valve], processes: int) -> dict[str, list[Valve]]:
    """
    Part a fleet among processes that each run estimators and detectors of several valves.

    :param valves: the fleet.
    :param processes: how many processes; 0: each node is its own.
    :return: the valves of each process by its name; none for 0.
    """
    return {f'monitors_{n + 1}': valves[n::processes] for n in range(min(processes, len(valves)))}
