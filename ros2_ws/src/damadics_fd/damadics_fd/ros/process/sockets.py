# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Nodes listen on sockets.

The shared memory of Fast DDS does not always outlive a kill, nor that its owner is held up: who is
a second or two in the middle of a message is taken for dead, and its memory is made anew, by
whoever sends and by itself. They need not agree: then the sender goes on writing into what is
nobody's any more, and the listener hears nothing, for ever, however often it is started again
(eProsima/Fast-DDS, pull request 4737). Who listens on sockets is sent to over sockets by all.
"""

import os
from pathlib import Path

PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
HERE = 'DEFAULT_FASTRTPS_PROFILES.xml'  # read in the folder in which a process is started
SOCKETS = Path(__file__).with_suffix('.xml')


def listen_on_sockets() -> None:
    """
    Have Fast DDS listen on sockets, in this process and in those that it starts.

    To be called before a node is made. What the user has chosen, in the environment or in a file
    of profiles, stays.
    """
    if not (os.environ.get(PROFILES) or os.environ.get(TRANSPORTS) or Path(HERE).exists()):
        os.environ[PROFILES] = str(SOCKETS)
