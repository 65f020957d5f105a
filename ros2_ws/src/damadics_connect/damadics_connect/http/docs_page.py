# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What can be asked of the HTTP connector, as one page that needs nothing from other machines."""

from collections.abc import Iterator, Mapping
from html import escape
from typing import TypeAlias

Schema: TypeAlias = Mapping[str, 'Part']
Part: TypeAlias = str | int | float | bool | None | list['Part'] | Schema
METHODS = ('get', 'post', 'put', 'delete')
STYLE = """
:root{color-scheme:light dark}body{font:14px/1.5 system-ui,sans-serif;max-width:900px;
margin:24px auto;padding:0 16px}h2{font-size:15px;margin:26px 0 4px}code{font-size:14px}
table{border-collapse:collapse;width:100%}td,th{text-align:left;padding:4px 10px 4px 0;
vertical-align:top;border-bottom:1px solid #8886}b{text-transform:uppercase;margin-right:8px}
"""


def docs_page(schema: Schema) -> str:
    """
    Return the page of an API.

    :param schema: as OpenAPI describes it.
    :return: HTML.

    >>> get = {'description': 'All.', 'parameters': [{'name': 'a<b', 'in': 'query'}]}
    >>> page = docs_page({'info': {'title': 'T'}, 'paths': {'/x': {'get': get}}})
    >>> 'a&lt;b' in page, 'All.' in page
    (True, True)
    """
    info = _part(schema, 'info')
    title = escape(str(info.get('title', '')))
    body = ''.join(
        f'<h2><b>{method}</b><code>{escape(path)}</code></h2>'
        f'<p>{escape(str(_part(both, method).get("description", "")))}</p>'
        f'{_table(_part(both, method), schema)}'
        for path in _part(schema, 'paths')
        for both in (_part(_part(schema, 'paths'), path),)
        for method in METHODS
        if method in both
    )
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>'
        f'<body><main><h1>{title}</h1><p>{escape(str(info.get("description", "")))}</p>'
        f'<p>For programs: <a href="openapi.json">openapi.json</a></p>{body}</main></body></html>'
    )


def _part(of: Schema, name: str) -> Schema:
    """Return an object within another, an empty one where there is none."""
    found = of.get(name)
    return found if isinstance(found, Mapping) else {}


def _table(call: Schema, schema: Schema) -> str:
    """Return what a call takes, in its address or its body."""
    rows = ''.join(
        f'<tr><td><code>{escape(name)}</code></td><td>{escape(kind)}</td>'
        f'<td>{escape(words)}</td></tr>'
        for name, kind, words in (*_parameters(call), *_fields(call, schema))
    )
    head = '<tr><th scope="col">what</th><th scope="col">type</th><th scope="col"></th></tr>'
    return f'<table>{head}{rows}</table>' if rows else ''


def _parameters(call: Schema) -> Iterator[tuple[str, str, str]]:
    given = call.get('parameters')
    for one in given if isinstance(given, list) else ():
        if isinstance(one, Mapping):
            where = str(one.get('in', ''))
            yield str(one.get('name', '')), _kind(_part(one, 'schema')), _words(one, where)


def _fields(call: Schema, schema: Schema) -> Iterator[tuple[str, str, str]]:
    content = _part(_part(_part(call, 'requestBody'), 'content'), 'application/json')
    name = str(_part(content, 'schema').get('$ref', '')).rpartition('/')[2]
    model = _part(_part(_part(schema, 'components'), 'schemas'), name)
    needed = model.get('required')
    for field in _part(model, 'properties'):
        part = _part(_part(model, 'properties'), field)
        must = isinstance(needed, list) and field in needed
        yield field, _kind(part), _words(part, 'body, needed' if must else 'body')


def _kind(part: Schema) -> str:
    return str(part.get('type', ''))


def _words(part: Schema, where: str) -> str:
    words = part.get('description') or _part(part, 'schema').get('description') or ''
    return f'{words} ({where})'.strip()
