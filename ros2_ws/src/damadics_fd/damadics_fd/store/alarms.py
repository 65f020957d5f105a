# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep the alarm of a detector over its restart, its kill included."""

import json
import os
from pathlib import Path
from typing import Any

from damadics_fd.ros.arguments import state_folder

FORMAT = 'damadics_fd alarm 1'
# what makes an alarm another one; the rest of the state changes with every sample
MARKS = ('active', 'latched', 'acknowledged', 'occurrence', 'worst', 'shelved_until', 'told')


def default_folder() -> Path:
    """
    Return where the alarms of this ROS domain are kept.

    :return: a folder of the user.
    """
    return state_folder() / f'domain_{os.environ.get("ROS_DOMAIN_ID", "0")}'


class AlarmStore:
    """
    One file with the state of one detector, replaced as a whole.

    :param path: the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._marks: Any = None

    def load(self) -> dict[str, Any] | None:
        """
        Read the state.

        :return: what `Detector.load` takes; None where there is no file.
        :raises ValueError: where the file is damaged, with the cause.
        """
        try:
            document = json.loads(self.path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as problem:
            raise ValueError(f'{self.path}: {problem}') from problem
        if (
            not isinstance(document, dict)
            or document.get('format') != FORMAT
            or not isinstance(document.get('state'), dict)
        ):
            raise ValueError(f'{self.path}: not in the format "{FORMAT}"')
        return document['state']

    def save(self, state: dict[str, Any]) -> None:
        """
        Write the state if the alarm has changed.

        :param state: what `Detector.save` returned.
        :raises OSError: where the file cannot be written.
        """
        marks = [state[name] for name in MARKS]
        if marks == self._marks:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        draft = self.path.with_suffix(f'.{os.getpid()}.tmp')
        with draft.open('w', encoding='utf-8') as stream:
            json.dump({'format': FORMAT, 'state': state}, stream, indent=1)
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(self.path)
        self._marks = marks
