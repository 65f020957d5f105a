# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Who is started where a node was killed listens on sockets.

The shared memory of Fast DDS does not always outlive a kill: whoever sends to a killed process may
go on writing into what was that one's memory, and the process that takes its place hears nothing,
however often it is started again (eProsima/Fast-DDS, pull request 4737). Who listens on sockets
is sent to over sockets by everybody, which takes more CPU time: hence only where one was killed.
"""

import fcntl
import os
from pathlib import Path

PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
HERE = 'DEFAULT_FASTRTPS_PROFILES.xml'  # read in the folder in which a process is started
SOCKETS = Path(__file__).with_suffix('.xml')
MEMORY = Path('/dev/shm')
FIRST_PORT, PORTS_OF_A_DOMAIN = 7400, 250  # RTPS 2.5, 9.6.2.3


def over_sockets_after_a_kill() -> None:
    """
    Have Fast DDS listen on sockets where a process of this ROS domain was killed.

    To be called before a node is made. What the user has chosen, in the environment or in a file
    of profiles, stays.
    """
    domain = os.environ.get('ROS_DOMAIN_ID') or '0'
    if not is_chosen() and domain.isdecimal() and left_by_killed(int(domain)):
        os.environ[PROFILES] = str(SOCKETS)


def is_chosen() -> bool:
    """
    Tell whether the user has chosen how Fast DDS sends.

    :return: true where the environment or a file of profiles says it.
    """
    return bool(os.environ.get(PROFILES) or os.environ.get(TRANSPORTS) or Path(HERE).exists())


def left_by_killed(domain: int, memory: Path = MEMORY) -> list[Path]:
    """
    Find what killed processes of a ROS domain have left of the memory in which they listened.

    :param domain: its number.
    :param memory: folder of the shared memory of this machine.
    :return: lock files that nobody holds, and those of which that cannot be told.
    """
    first = FIRST_PORT + PORTS_OF_A_DOMAIN * domain
    locks = (memory / f'fastrtps_port{first + n}_el' for n in range(PORTS_OF_A_DOMAIN))
    return [lock for lock in locks if _is_left(lock)]


def _is_left(lock: Path) -> bool:
    """Tell whether a lock file is there and nobody holds it: who ends in peace removes it."""
    try:
        number = os.open(lock, os.O_RDONLY)
    except FileNotFoundError:
        return False
    except OSError:  # of another user: nobody here can clear it away
        return True
    try:
        fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(number)
    return True
