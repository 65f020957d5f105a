# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""List a server's variables and propose a configuration from their names."""

import re
from collections.abc import Iterable
from typing import NamedTuple

from asyncua import Client, Node, ua
from damadics_fd.core.text import NAME, plain

from damadics_connect.opcua.limits import limits_of
from damadics_connect.opcua.values import node_id

MOST = 100_000  # nodes looked at
DEEPEST = 12  # levels of folders
# The last part of a name and the signal it stands for; control rooms write them in many ways.
ENDINGS = {
    'cv': r'(?:CV|MV|OP|OUT|SP_?POS|SETPOINT|SET|W)',
    'x1': r'(?:PV|X1?|POS|POSITION|TRAVEL|ZT|GT|FB|FEEDBACK|RUECK\w*)',
    'p1': r'(?:P1|PIN|P_IN|PT1|UPSTREAM\w*)',
    'p2': r'(?:P2|POUT|P_OUT|PT2|DOWNSTREAM\w*)',
    't1': r'(?:T1?|TT1?|TEMP\w*)',
    'flow': r'(?:F|FT|FLOW|FI)',
    'ps': r'(?:PS|PCH|CHAMBER\w*|ACTUATOR_?P\w*)',
}
SPLIT = re.compile(r'^(?P<valve>.*?[0-9][0-9A-Za-z]*?)[._\-/ ]?(?P<end>[A-Za-z][A-Za-z_]*[0-9]?)$')


class Variable(NamedTuple):
    """A variable of the server: node id, browse path and unit."""

    node: str
    path: tuple[str, ...]
    unit: str = ''


class Proposal(NamedTuple):
    """A valve that the names suggest."""

    tag: str
    signals: dict[str, Variable]


def match(variables: Iterable[Variable]) -> list[Proposal]:
    """
    Sort variables into valves by their names.

    :param variables: of a server.
    :return: valves that have at least a control value and a position.

    >>> match([Variable('ns=2;s=a', ('LC51_03CV',)), Variable('ns=2;s=b', ('LC51_03X',))])[0].tag
    'LC51_03'
    >>> pair = [Variable('i=1', ('LV101', 'MV')), Variable('i=2', ('LV101', 'PV'))]
    >>> sorted(match(pair)[0].signals)
    ['cv', 'x1']
    """
    found: dict[str, dict[str, Variable]] = {}
    for variable in variables:
        name = variable.path[-1]
        last = re.split(r'[./]', name)[-1]
        signal = signal_of(last)
        if signal and last != name:
            tag = name[: -len(last) - 1]
        elif signal and len(variable.path) > 1:
            tag = variable.path[-2]
        elif parts := SPLIT.match(name):
            tag, signal = parts['valve'], signal_of(parts['end'])
        else:
            continue
        if signal and any(character.isdigit() for character in tag):
            found.setdefault(tag, {}).setdefault(signal, variable)
    return [Proposal(tag, s) for tag, s in sorted(found.items()) if {'cv', 'x1'} <= s.keys()]


def signal_of(ending: str) -> str:
    """
    Return the signal that the end of a name stands for.

    :param ending: such as `PV`.
    :return: field of `Measurement`, '' for none.
    """
    for signal, pattern in ENDINGS.items():
        if re.fullmatch(pattern, ending, re.IGNORECASE):
            return signal
    return ''


async def variables_of(client: Client) -> list[Variable]:
    """
    Walk through a server's objects.

    :param client: connected.
    :return: its numeric variables outside the server's own namespace.
    """
    found: list[Variable] = []
    seen: set[ua.NodeId] = set()
    level: list[tuple[Node, tuple[str, ...]]] = [(client.nodes.objects, ())]
    most = (await limits_of(client)).browses
    for _ in range(DEEPEST):
        below: list[tuple[Node, tuple[str, ...]]] = []
        for begin in range(0, len(level), most):
            some_of = level[begin : begin + most]
            results = await client.browse_nodes([node for node, _ in some_of])
            for (_, path), (_, result) in zip(some_of, results, strict=True):
                for reference in await _all_references(client, result):
                    nodeid = node_id(reference.NodeId.Identifier, reference.NodeId.NamespaceIndex)
                    if nodeid in seen or not nodeid.NamespaceIndex or len(seen) > MOST:
                        continue
                    seen.add(nodeid)
                    name = plain(reference.BrowseName.Name or '', NAME)
                    if reference.NodeClass == ua.NodeClass.Variable:
                        found.append(Variable(nodeid.to_string(), (*path, name)))
                    below.append((client.get_node(nodeid), (*path, name)))
        level = below
        if not level:
            break
    return found


async def _all_references(
    client: Client, result: ua.BrowseResult
) -> list[ua.ReferenceDescription]:
    """Return what a node refers to, also where the server hands it over in parts."""
    found = list(result.References or ())
    while (point := result.ContinuationPoint) and len(found) < MOST:
        rest = ua.BrowseNextParameters(ContinuationPoints=[point])
        (result,) = await client.uaclient.session.browse_next(rest)
        found += result.References or ()
    return found


async def propose(client: Client, url: str) -> str:
    """
    Write a configuration for what a server has.

    :param client: connected.
    :param url: of the server.
    :return: YAML; what was found and not used is in comments.
    """
    variables = await variables_of(client)
    proposals = match(variables)
    used = {variable.node for proposal in proposals for variable in proposal.signals.values()}
    lines = [
        f'# {len(variables)} variables, {len(proposals)} valves by their names. Check units and',
        '# directions: cv and x1 are fractions with 1 = closed; {unit: "%", invert: true} makes',
        '# them so where 100 % means open.',
        f'server: {url}',
        "period: 1.0        # s, of the valve's samples",
        'valves:' if proposals else 'valves: {}',
    ]
    for proposal in proposals:
        key = re.sub(r'[^a-z0-9]+', '_', proposal.tag.lower()).strip('_')
        key = key if key[:1].isalpha() else f'v{key}'
        lines += [f'  {key}:', f'    actuator: {_quoted(proposal.tag)}', '    signals:']
        lines += [
            f'      {signal}: {{node: {_quoted(variable.node)}}}   # {"/".join(variable.path)}'
            for signal, variable in proposal.signals.items()
        ]
    rest = [variable for variable in variables if variable.node not in used]
    if rest:
        lines.append('# not used:')
    lines += [f'#   {variable.node}   {"/".join(variable.path)}' for variable in rest]
    return '\n'.join(lines)


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
