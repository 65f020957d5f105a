# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Nodes listen on sockets.

The shared memory of Fast DDS does not always outlive a kill, nor that its owner is held up: who is
a second or two in the middle of a message is taken for dead, and its memory is made anew, by
whoever sends and by itself. They need not agree: then the sender goes on writing into what is
nobody's any more, and the listener hears nothing, for ever, however often it is started again
(eProsima/Fast-DDS, pull request 4737). Who listens on sockets is sent to over sockets by all.

Messages wait in the buffer of the socket while a process is held up. What finds no room is sent
again, but for what its publisher keeps no longer, as all but the last word of a latched topic: so
the buffer is as large as the kernel allows (`net.core.rmem_max`). A profile cannot say that where
discovery is limited to LOCALHOST.
"""

import contextlib
import os
import socket
from pathlib import Path

PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
HERE = 'DEFAULT_FASTRTPS_PROFILES.xml'  # read in the folder in which a process is started
SOCKETS = Path(__file__).with_suffix('.xml')
ROOM = 4_194_304  # bytes of messages that may wait: seconds of several valves


def listen_on_sockets() -> None:
    """
    Have Fast DDS listen on sockets, in this process and in those that it starts.

    To be called before a node is made. What the user has chosen, in the environment or in a file
    of profiles, stays.
    """
    if not (os.environ.get(PROFILES) or os.environ.get(TRANSPORTS) or Path(HERE).exists()):
        os.environ[PROFILES] = str(SOCKETS)


def let_messages_wait() -> None:
    """
    Make room in the sockets on which this process listens.

    To be called once its nodes are made. A socket that has more room keeps it.
    """
    for file in Path('/proc/self/fd').glob('*'):
        with contextlib.suppress(OSError):  # closed meanwhile, or not a socket
            # Never a copy of the descriptor: to close one takes away the locks of this process.
            own = socket.socket(fileno=int(file.name))
            try:
                if (own.family, own.type) == (socket.AF_INET, socket.SOCK_DGRAM):
                    _make_room(own)
            finally:
                own.detach()


def _make_room(listening: socket.socket) -> None:
    """Have a socket hold `ROOM` bytes, where it holds less; the kernel counts them twice."""
    size = (socket.SOL_SOCKET, socket.SO_RCVBUF)
    if listening.getsockopt(*size) < 2 * ROOM:
        listening.setsockopt(*size, ROOM)
