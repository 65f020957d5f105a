# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What running nodes make, against what the SROS 2 policy of their fleet allows."""

from xml.etree.ElementTree import Element, ElementTree


def allowed(profile: Element, verb: str) -> set[str]:
    """Return the full names that a node may publish, subscribe, reply or request."""
    node = f'{profile.get("ns").rstrip("/")}/{profile.get("node")}'
    return {e.text.replace('~', node, 1) for e in profile.findall(f'*[@{verb}]/*')}


def assert_allowed(peer, policy: ElementTree, name: str, namespace: str = '/') -> None:
    """With SROS 2 enforced, a node that may not make one of its topics does not start."""
    found = [
        profile
        for profile in policy.getroot().iter('profile')
        if (profile.get('node'), profile.get('ns')) == (name, namespace)
    ]
    assert len(found) == 1, f'{name} has {len(found)} profiles'
    graph = peer.node
    assert peer.wait(lambda: (name, namespace) in graph.get_node_names_and_namespaces())
    serves = graph.get_service_names_and_types_by_node
    assert peer.wait(lambda: serves(name, namespace)), f'{name} serves nothing'
    for verb, made in (
        ('publish', graph.get_publisher_names_and_types_by_node(name, namespace)),
        ('subscribe', graph.get_subscriber_names_and_types_by_node(name, namespace)),
        ('reply', serves(name, namespace)),
        ('request', graph.get_client_names_and_types_by_node(name, namespace)),
    ):
        refused = {topic for topic, _ in made} - allowed(found[0], verb)
        assert not refused, f'{name} may not {verb} {refused}'
