# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the server writes of visitors: a line for what is malformed, not a traceback."""

import logging

LOGGERS = ('engineio.server', 'socketio.server')


def one_line(record: logging.LogRecord) -> bool:
    """
    Make a line of an error with its traceback.

    :param record: to be logged, changed.
    :return: True: log it.
    """
    if record.exc_info and record.exc_info[1]:
        error = record.exc_info[1]
        first = str(error).splitlines()[:1] or ['']
        record.msg = f'a malformed message was refused: {type(error).__name__}: {first[0][:200]}'
        record.args, record.exc_info, record.exc_text = (), None, None
    return True


def keep_short() -> None:
    """Have what visitors send take a line of the log each."""
    for name in LOGGERS:
        logging.getLogger(name).addFilter(one_line)
