# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Wait for changes of the ROS graph instead of asking for them.

rcl has a guard condition for this, which rclpy does not hand out; it is waited for with rcl's own
functions.
"""

import ctypes
import threading
from collections.abc import Callable

from rclpy.node import Node

WAIT = 200_000_000  # [ns] after which the end of the thread is looked for
OK, TIMEOUT = 0, 2  # return codes of rcl


class _WaitSet(ctypes.Structure):
    """The structure rcl_wait_set_t: six pairs of array and size, and what rcl keeps."""

    _fields_ = [
        *((f'{kind}_{part}', ctypes.c_size_t) for kind in range(6) for part in range(2)),
        ('impl', ctypes.c_void_p),
    ]


class _Allocator(ctypes.Structure):
    """The structure rcl_allocator_t."""

    _fields_ = [(f'p{i}', ctypes.c_void_p) for i in range(5)]


class GraphEvents:
    """
    Call a function in a thread of its own whenever the graph may have changed.

    :param node: whose view of the graph it is.
    :param changed: called after a change; it must not touch the node, only tell others.
    :raises OSError: where rcl cannot be reached.
    """

    def __init__(self, node: Node, changed: Callable[[], None]):
        try:
            self._rcl = ctypes.CDLL('librcl.so')
            self._guard = self._function('rcl_node_get_graph_guard_condition', ctypes.c_void_p)(
                ctypes.c_void_p(node.handle.pointer)
            )
            self._context = node.context.handle.pointer
        except AttributeError as error:
            raise OSError(str(error)) from error
        if not self._guard:
            raise OSError('this middleware has no events of the graph')
        self._changed = changed
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='graph', daemon=True)
        self._thread.start()

    def _function(self, name: str, result: type) -> 'ctypes._NamedFuncPointer':
        function: ctypes._NamedFuncPointer = getattr(self._rcl, name)
        function.restype = result
        return function

    def _run(self) -> None:
        allocator = self._function('rcutils_get_default_allocator', _Allocator)()
        waiting = self._function('rcl_get_zero_initialized_wait_set', _WaitSet)()
        place, guard = ctypes.byref(waiting), ctypes.c_void_p(self._guard)
        none = [ctypes.c_size_t(0)] * 4
        context = ctypes.c_void_p(self._context)
        sizes = (ctypes.c_size_t(0), ctypes.c_size_t(1), *none)
        if self._rcl.rcl_wait_set_init(place, *sizes, context, allocator) != OK:
            return
        while not self._stop.is_set():
            self._rcl.rcl_wait_set_clear(place)
            self._rcl.rcl_wait_set_add_guard_condition(place, guard, None)
            code = self._rcl.rcl_wait(place, ctypes.c_int64(WAIT))
            if code == OK:
                self._changed()
            elif code != TIMEOUT:
                break
        self._rcl.rcl_wait_set_fini(place)

    def close(self) -> None:
        """End the thread; before the node is destroyed."""
        self._stop.set()
        self._thread.join()
