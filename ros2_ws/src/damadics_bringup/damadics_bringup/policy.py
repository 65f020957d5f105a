# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `policy`: the SROS 2 policy of a fleet, in which each node may do what it needs."""

import argparse
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from damadics_dashboard.live.record import ACTIONS
from damadics_fd.ros.arguments import command_parser
from damadics_fd.store.fleet_file import FleetError, Valve, read_fleet

from damadics_bringup.fleet import MONITORS, spread

EXAMPLES = """examples:
  ros2 run damadics_bringup policy fleet.yaml --out policy.xml
  ros2 run damadics_bringup policy fleet.yaml --blocks --out policy.xml    with the node fleet
  ros2 run damadics_bringup policy fleet.yaml --connect opcua --connect notify --out policy.xml
  ros2 security create_keystore keystore
  ros2 security generate_artifacts -k keystore -p policy.xml"""
# what rclpy makes for every node: without the right to it, a node does not start
EVERY_NODE = (
    'describe_parameters',
    'get_parameter_types',
    'get_parameters',
    'list_parameters',
    'set_parameters',
    'set_parameters_atomically',
    'get_type_description',
)
LIFECYCLE = (
    'change_state',
    'get_available_states',
    'get_available_transitions',
    'get_state',
    'get_transition_graph',
)
SAMPLES = ('measurement', 'estimate', 'threshold', 'fault_flag', 'fault_event')
SHOWN = (*SAMPLES, 'signature', 'isolation', 'operator_action')  # by the page
ALL = (*SAMPLES, 'residual', 'signature', 'fault_state', 'operator_action', 'isolation')


@dataclass
class Rights:
    """What one node may do; a name without a leading slash is of its valve."""

    publish: Sequence[str] = ()
    subscribe: Sequence[str] = ()
    reply: Sequence[str] = ()
    request: Sequence[str] = field(default=())


NODES = {  # of every valve
    'estimator': Rights(
        ('estimate', 'isolation', 'operator_action', '/diagnostics', '~/transition_event'),
        ('measurement',),
        ('relearn', 'save_reference', 'load_reference', *(f'~/{name}' for name in LIFECYCLE)),
    ),
    'detector': Rights(
        (
            'residual',
            'threshold',
            'fault_flag',
            'fault_event',
            'signature',
            'isolation',
            'operator_action',
            'stroke_request',
            '/diagnostics',
            '~/transition_event',
        ),
        ('estimate', 'fault_flag', 'isolation'),
        ('acknowledge', 'reset', 'shelve', 'partial_stroke', *(f'~/{name}' for name in LIFECYCLE)),
    ),
    'driver': Rights(
        ('measurement',), ('stroke_request',)
    ),  # of the plant: its name is for you to choose
}
EXPOSED = (
    'fault_flag',
    'fault_event',
    'isolation',
    'signature',
    'estimate',
    'residual',
    'threshold',
    'stroke_request',
)
FLEET_TOPICS = tuple(f'fleet/{name}' for name in ('layout', 'status', 'fault_event', 'isolation'))
FLEET_SERVICES = tuple(
    f'fleet/{name}' for name in ('acknowledge', 'reset', 'shelve', 'relearn', 'reference')
)
JUDGED = ('fault_flag', 'fault_event')  # what the connectors follow
FLEET_JUDGED = ('fleet/layout', 'fleet/status', 'fleet/fault_event')
OPERATED = ('acknowledge', 'reset', 'shelve', 'partial_stroke')  # by their users
CONNECTORS = {  # nodes of damadics_connect: their rights in every valve, and of the root
    'opcua': (
        Rights(('measurement',), (*JUDGED, 'signature', 'operator_action'), (), OPERATED),
        Rights(('measurement_block', 'fleet/layout', '/diagnostics'), FLEET_JUDGED),
    ),
    'mqtt': (
        Rights(('measurement',), JUDGED),
        Rights(('measurement_block', 'fleet/layout', '/diagnostics'), FLEET_JUDGED),
    ),
    'http': (
        Rights((), JUDGED, (), OPERATED),
        Rights((), FLEET_JUDGED),
    ),
    'notify': (
        Rights((), JUDGED),
        Rights(('/diagnostics',), FLEET_JUDGED),
    ),
    'files': (
        Rights(('measurement',)),
        Rights(('measurement_block', 'fleet/layout', '/diagnostics')),
    ),
}
PLANT = Rights(('measurement', 'fault_state', '/clock'), ('stroke_request',), ('inject_fault',))


def policy(
    valves: Sequence[Valve],
    simulate: bool = False,
    processes: int = 0,
    blocks: bool = False,
    connect: Sequence[str] = (),
) -> 'ET.ElementTree[ET.Element]':
    """
    Write down what each node of a fleet may do.

    :param valves: the fleet.
    :param simulate: also for the simulated plants.
    :param processes: as given to `run`: nodes of one process share its enclave.
    :param blocks: as given to `run`: one node `fleet` judges all valves.
    :param connect: the connectors that run, names of CONNECTORS.
    :return: a document of the form that `ros2 security` takes (version 0.2.0).
    """
    root = ET.Element('policy', version='0.2.0')
    enclaves = ET.SubElement(root, 'enclaves')
    process_of = {
        valve.name: name
        for name, group in spread(list(valves), processes).items()
        for valve in group
    }
    if blocks:
        exposed = _all(valves, Rights(EXPOSED, ('measurement',), ('partial_stroke',)))
        rights = Rights(
            (*FLEET_TOPICS, 'operator_action', '/diagnostics', *exposed.publish),
            ('fleet/layout', 'measurement_block', *exposed.subscribe),
            (*FLEET_SERVICES, *exposed.reply),
        )
        _enclave(enclaves, '/', 'fleet', _of_root(rights))
    nodes = {name: one for name, one in NODES.items() if not (blocks and name in MONITORS)}
    for valve in valves:
        for node, rights in {**nodes, **({'plant': PLANT} if simulate else {})}.items():
            shared = process_of.get(valve.name, '') if node in MONITORS else ''
            _enclave(enclaves, f'/{valve.name}', node, _of_valve(rights, valve), shared)
    operate = (*ACTIONS, 'inject_fault') if simulate else ACTIONS
    page = _all(valves, Rights((), SHOWN, (), operate))
    _enclave(
        enclaves,
        '/',
        'dashboard',
        _of_root(
            Rights(
                (),
                (*page.subscribe, *FLEET_TOPICS, 'operator_action', '/diagnostics'),
                (),
                (*page.request, *FLEET_SERVICES),
            )
        ),
    )
    for name in dict.fromkeys(connect):
        _enclave(enclaves, '/', name, _of_connector(name, valves))
    events = [
        f'/{v.name}/{node}/transition_event' for v in valves for node in ('estimator', 'detector')
    ]
    _enclave(
        enclaves,
        '/',
        'recorder',
        Rights(
            ('/diagnostics',),
            (
                *_all(valves, Rights((), ALL)).subscribe,
                *(f'/{n}' for n in (*ALL, *FLEET_TOPICS, 'measurement_block')),
                '/diagnostics',
                '/rosout',
                '/parameter_events',
                *events,
            ),
        ),
    )
    ET.indent(root)
    return ET.ElementTree(root)


def _of_connector(name: str, valves: Sequence[Valve]) -> Rights:
    """Give a connector its rights in all valves, and in what one node has of them."""
    in_valves, rights = CONNECTORS[name]
    of_valves, of_root = _all(valves, in_valves), _of_root(rights)
    fleet = [f'/{name}' for name in FLEET_SERVICES if name.removeprefix('fleet/') in OPERATED]
    return Rights(
        publish=(*of_valves.publish, *of_root.publish),
        subscribe=(*of_valves.subscribe, *of_root.subscribe),
        request=(*of_valves.request, *(fleet if of_valves.request else ())),
    )


def _of_valve(rights: Rights, valve: Valve) -> Rights:
    """Give names their full form, with the topics where they are on the plant."""

    def full(names: Iterable[str]) -> list[str]:
        named = (valve.topics.get(name, name) for name in names)
        return [name if name[0] in '/~' else f'/{valve.name}/{name}' for name in named]

    return Rights(
        full(rights.publish), full(rights.subscribe), full(rights.reply), full(rights.request)
    )


def _of_root(rights: Rights) -> Rights:
    """Give names their full form: those of a node that serves all valves."""

    def full(names: Iterable[str]) -> list[str]:
        return [name if name[0] in '/~' else f'/{name}' for name in names]

    return Rights(
        full(rights.publish), full(rights.subscribe), full(rights.reply), full(rights.request)
    )


def _all(valves: Iterable[Valve], rights: Rights) -> Rights:
    """Collect the rights in all valves."""
    each = [_of_valve(rights, valve) for valve in valves]
    return Rights(
        publish=[name for one in each for name in one.publish],
        subscribe=[name for one in each for name in one.subscribe],
        reply=[name for one in each for name in one.reply],
        request=[name for one in each for name in one.request],
    )


def _enclave(
    enclaves: ET.Element, namespace: str, node: str, rights: Rights, shared: str = ''
) -> None:
    """Add a node's profile to its own enclave, or to the one of its process."""
    path = f'/{shared}' if shared else f'{namespace.rstrip("/")}/{node}'
    profiles = enclaves.find(f"enclave[@path='{path}']/profiles")
    if profiles is None:
        profiles = ET.SubElement(ET.SubElement(enclaves, 'enclave', path=path), 'profiles')
    profile = ET.SubElement(profiles, 'profile', ns=namespace, node=node)
    for kind, verb, names in (
        ('topic', 'subscribe', (*rights.subscribe, '/clock')),
        ('topic', 'publish', (*rights.publish, '/rosout', '/parameter_events')),
        ('service', 'reply', (*rights.reply, *(f'~/{name}' for name in EVERY_NODE))),
        ('service', 'request', rights.request),
    ):
        if names:
            group = ET.SubElement(profile, f'{kind}s', {verb: 'ALLOW'})
            for name in dict.fromkeys(names):
                ET.SubElement(group, kind).text = name


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'policy', 'Write the SROS 2 policy of a fleet: one enclave per node.', EXAMPLES
    )
    p.add_argument('fleet', type=Path, help='list of the valves (YAML)')
    p.add_argument('--simulate', action='store_true', help='also for the simulated plants')
    p.add_argument('--processes', type=int, default=0, metavar='N', help='as given to run')
    p.add_argument(
        '--blocks', action='store_true', help='as given to run: one node fleet judges all valves'
    )
    p.add_argument(
        '--connect',
        action='append',
        default=[],
        choices=CONNECTORS,
        help='also for this connector of damadics_connect; may be given several times',
    )
    p.add_argument('--out', type=Path, metavar='FILE', help='write it here (standard output)')
    return p


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    options = parser().parse_args(args)
    try:
        valves = read_fleet(options.fleet)
        tree = policy(valves, options.simulate, options.processes, options.blocks, options.connect)
        text = ET.tostring(tree.getroot(), encoding='unicode', xml_declaration=True) + '\n'
        if options.out:
            options.out.write_text(text)
            print(f'written: {options.out}')
        else:
            print(text, end='')
    except (FleetError, OSError) as problem:
        print(f'policy: {problem}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
