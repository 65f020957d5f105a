# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Records: one declaration gives the layout in memory, the static type and the check of saved data.

State and settings of compiled loops are rows of structured arrays. A class declares the fields:

>>> class Counter(Record):
...     seen: int
...     peak: float
...     recent: Annotated[Floats, 3]
>>> Counter.dtype().names
('seen', 'peak', 'recent')
>>> rows = Counter.rows()

A function that is compiled states which record it takes, `def step(s: Counter, x: float) -> None`,
and mypy checks every field that it touches. A function that is called from Python takes the
array, `def update(s: Rows[Counter], x: float) -> None: step(s[0], x)`.

>>> rows['peak'] = 2.5
>>> Counter.plain(rows)
{'seen': 0, 'peak': 2.5, 'recent': [0.0, 0.0, 0.0]}
>>> Counter.read({'seen': 1, 'peak': 2.0}, 'counter')
Traceback (most recent call last):
ValueError: counter: recent missing or unknown
"""

import inspect
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from typing import (
    Annotated,
    Any,
    Protocol,
    Self,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Array: TypeAlias = NDArray[np.void]
Plain: TypeAlias = None | bool | int | float | str | list['Plain'] | dict[str, 'Plain']
Saved: TypeAlias = dict[str, Plain]
Json: TypeAlias = None | bool | int | float | str | Sequence['Json'] | Mapping[str, 'Json']

R = TypeVar('R', covariant=True)
KINDS: dict[object, str] = {int: 'i8', float: 'f8', bool: '?'}
SUITS = {'f': 'fiu', 'i': 'iu', 'b': 'b'}  # kinds of plain numbers that a kind of field takes


def _field_first(row: np.record, name: str) -> Any:
    """Return a field, else what numpy knows by the name."""
    fields = np.void.__getattribute__(row, 'dtype').fields or {}
    if name not in fields:
        return np.record.__getattribute__(row, name)
    value = row[name]
    return value.view((Row, value.dtype)) if value.dtype.names and not value.ndim else value


# a row whose fields hide numpy's own attributes: a field may be called `base` or `mean`
Row = type('Row', (np.record,), {'__getattribute__': _field_first, '__module__': __name__})


class Rows(Protocol[R]):
    """What a compiled function sees of a structured array: rows that are records."""

    def __getitem__(self, index: int, /) -> R:
        """Return one row, which is a view."""

    def __len__(self) -> int:
        """Return the number of rows."""


def stacked(parts: Iterable[Array]) -> Array:
    """
    Return the rows of some arrays in one array.

    :param parts: at least one array, all of one layout.
    :return: a new array; `numpy.concatenate` would forget that rows are records.
    """
    arrays = list(parts)
    rows = np.zeros(sum(map(len, arrays)), arrays[0].dtype)
    at = 0
    for array in arrays:
        rows[at : at + len(array)] = array
        at += len(array)
    return rows


class Record:
    """
    Declare a record by annotations; see the module.

    A field is `int` (64 bit), `float`, `bool`, another record, `Annotated[Floats, 3, 2]` for an
    array of that shape (`Ints` likewise), or `Annotated[Rows[Other], 3]` for an array of records.
    Fields of base classes come first, in the order of the bases.
    """

    @classmethod
    def dtype(cls) -> np.dtype[np.void]:
        """
        Return the layout of the record.

        :return: aligned structured dtype.
        """
        known = _layouts.get(cls)
        if known is None:
            known = _layouts[cls] = _layout(cls)
        return known

    @classmethod
    def rows(cls, count: int = 1) -> Array:
        """
        Return new records.

        :param count: how many.
        :return: structured array of zeros.
        """
        return np.zeros(count, cls.dtype())

    @classmethod
    def new(cls) -> Self:
        """
        Return a new record.

        :return: the only row of a structured array of zeros.
        """
        row: Self = cls.rows()[0]
        return row

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """
        Return the names of the fields.

        :return: in the order of their declaration.
        """
        return cls.dtype().names or ()

    @classmethod
    def plain(cls, rows: Array, names: Iterable[str] | None = None) -> Saved:
        """
        Return a record as plain data, fit for JSON.

        A record within it is told by its fields: `pressure.a` becomes `pressure_a`.

        :param rows: structured array of length 1.
        :param names: the fields to return; all where it is None.
        :return: numbers and lists by name.
        """
        chosen = cls.names() if names is None else names
        return {name: part[0].tolist() for name, part in _leaves(rows, chosen)}

    @classmethod
    def read(
        cls, saved: Mapping[str, Plain], what: str, names: Iterable[str] | None = None
    ) -> Array:
        """
        Return the record that `plain` told, checked.

        :param saved: numbers and lists by name.
        :param what: the data's name in error texts.
        :param names: the fields to read, the others stay 0; all where it is None.
        :return: structured array of length 1.
        :raises ValueError: naming the fields that are missing, unknown, of another kind or shape
            or not finite.
        """
        rows = cls.rows()
        parts = dict(_leaves(rows, cls.names() if names is None else names))
        wrong = sorted(set(saved) ^ set(parts))
        if wrong:
            raise ValueError(f'{what}: {", ".join(wrong)} missing or unknown')
        for name, part in parts.items():
            part[0] = _fitting(saved[name], part[0], f'{what}: {name}')
        return rows


def _fitting(value: Plain, part: NDArray[np.generic], what: str) -> NDArray[np.generic]:
    """Return a plain value as the array that a field takes."""
    try:
        given = np.asarray(value)
    except ValueError as error:
        raise ValueError(f'{what} = {reprlib.repr(value)} does not fit: {error}') from error
    shape, kind = np.shape(part), part.dtype.kind
    if given.shape != shape or given.dtype.kind not in SUITS[kind]:
        needed = {'f': 'numbers', 'i': 'whole numbers', 'b': 'true or false'}[kind]
        raise ValueError(
            f'{what} = {reprlib.repr(value)} does not fit: it takes {needed} of the shape {shape}'
        )
    fitting = given.astype(part.dtype)
    if kind == 'f' and not np.isfinite(fitting).all():
        raise ValueError(f'{what} = {reprlib.repr(value)} is not finite')
    if kind == 'i' and (fitting != given).any():
        raise ValueError(f'{what} = {reprlib.repr(value)} is too large')
    return fitting


def _leaves(rows: Array, names: Iterable[str]) -> list[tuple[str, NDArray[np.generic]]]:
    """Return views of all fields that hold numbers, with the name each has in plain data."""
    leaves: list[tuple[str, NDArray[np.generic]]] = []
    for name in names:
        part = rows[name]
        within = part.dtype.names
        if within:
            leaves += [(f'{name}_{leaf}', view) for leaf, view in _leaves(part, within)]
        else:
            leaves.append((name, part))
    return leaves


_layouts: dict[type[Record], np.dtype[np.void]] = {}


def _layout(kind: type[Record]) -> np.dtype[np.void]:
    hints = get_type_hints(kind, include_extras=True)
    columns = [(name, *_column(hints[name])) for name in _declared(kind)]
    return np.dtype((Row, np.dtype(columns, align=True)))


def _declared(kind: type) -> dict[str, None]:
    """Return the names of all fields in order."""
    names: dict[str, None] = {}
    for base in kind.__bases__:
        names |= _declared(base)
    return names | dict.fromkeys(inspect.get_annotations(kind))


def _column(hint: type) -> tuple[np.dtype[np.generic], tuple[int, ...]]:
    """Return type and shape of one field."""
    shape: tuple[int, ...] = ()
    if get_origin(hint) is Annotated:
        array, *shape_ = get_args(hint)
        shape = tuple(shape_)
        inner = get_args(array)
        hint = get_args(inner[-1])[0] if get_origin(inner[-1]) is np.dtype else inner[-1]
    if isinstance(hint, type) and issubclass(hint, Record):
        return hint.dtype(), shape
    return np.dtype(KINDS.get(hint, hint)), shape
