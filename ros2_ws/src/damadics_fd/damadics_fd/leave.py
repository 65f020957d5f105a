# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the executables end: their exit code is theirs, whatever the middleware's end takes."""

import atexit
import ctypes
import os
import signal
import sys
from collections.abc import Callable

PATIENCE = 3.0  # s that the end of the middleware may take; it needs some 10 ms
FAILED = 1  # exit code of an exception that nobody has caught
INTERRUPTED = 130
CRASHES = (signal.SIGABRT, signal.SIGSEGV, signal.SIGBUS)
UNWRITTEN = 120  # of Python where its last output cannot be written


def ending(main: Callable[[], int]) -> int:
    """
    Run the work of a process, and have the process end with it.

    Fast DDS 2.14 may spin in the destructor of its participants, which libc's `exit` calls: where
    another participant is just being discovered, it keeps a core busy and the discovery from its
    lock (https://github.com/eProsima/Fast-DDS/issues/6513). Without the destructors its shared
    memory would be left behind. So they are given a time. What crashes there is left hanging for
    that time: the work is done, and its code is told.

    :param main: the work.
    :return: its exit code, for `sys.exit`.
    """
    codes = [FAILED]
    atexit.register(lambda: _leave(codes[-1]))  # the first to be registered is the last called
    try:
        codes.append(main())
    except KeyboardInterrupt:
        codes.append(INTERRUPTED)
        raise
    except SystemExit as end:
        codes.append(end.code if isinstance(end.code, int) else int(end.code is not None))
        raise
    return codes[-1]


def _leave(code: int) -> None:
    """End the process: threads are joined and the other functions of atexit are done."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):  # nobody reads it any more, or it is closed
            code = code or UNWRITTEN
    # A thread of the system's and a wait that keeps the interpreter's lock: no Python runs any
    # more, as after the interpreter's own end.
    libc = ctypes.PyDLL(None)
    for crash in CRASHES:
        libc.signal(int(crash), libc.pause)
    thread = ctypes.c_ulong()
    libc.pthread_create(ctypes.byref(thread), None, libc.exit, ctypes.c_void_p(code))
    libc.usleep(int(PATIENCE * 1e6))
    os._exit(code)
