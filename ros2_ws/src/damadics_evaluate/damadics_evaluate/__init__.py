# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judge detectors with the indices of the DAMADICS benchmark definition."""


def main(argv: list[str] | None = None) -> int:
    """
    Run the command `evaluate`.

    :param argv: arguments, by default those of the process.
    :return: exit code.
    """
    from damadics_fd.start import one_thread

    one_thread()
    from damadics_evaluate import command

    return int(command.main(argv))
