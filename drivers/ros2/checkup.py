"""Which robots of ROS 2 there are at a router, and how they speak: as rmw_zenoh, or by a bridge from DDS."""

from collections.abc import Iterator
from threading import Event
from typing import Any

from drivers.api.driver import Finding, Site, wrong
from drivers.ros2 import wire
from drivers.ros2.declared import ZenohKeys
from drivers.ros2.make import domain_of
from drivers.ros2.node import Node
from drivers.ros2.session import OFFERED, access_of, open_session

LISTEN = 1.0
"""Seconds in which nodes and bridges make themselves known."""

CURE = (
    "start nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp (Jazzy and newer), or on the robot `zenoh-bridge-ros2dds`, "
    "whose version must be 1.0 or newer  (docs/ros2.md)"
)


def checkup(keys: ZenohKeys, site: Site) -> Iterator[Finding]:
    """Open a session for a moment, and listen. Raises NotConnected, with what to try."""
    access, domain = access_of(keys, site.port), domain_of(keys)
    where = ", ".join(access.endpoints)
    session: Any = open_session("ros2", access, patience=2.0)
    try:
        node = Node(session, site.clock, domain=domain, name="mission_checkup")
        Event().wait(LISTEN)
        if not (session.info.routers_zid() or session.info.peers_zid()):
            yield wrong("router", f"{where}: no router of Zenoh answers", OFFERED)
            return
        yield Finding("router", f"{where}: answers")
        yield _nodes(node, session, domain)
        node.close()
    finally:
        session.close()


def _nodes(node: Node, session: Any, domain: int) -> Finding:
    everybody = node.entities()
    nodes = sum(each.role == wire.NODE and not each.bridged for each in everybody)
    behind = {each.name for each in everybody if each.bridged and each.role != wire.NODE}
    found = [f"{nodes} node{'s' * (nodes != 1)} by rmw_zenoh in domain {domain}"] * bool(nodes)
    if node.bridged:
        found.append(f"{wire.BRIDGE} with {len(behind)} topics and services, whose domain is its own")
    if found:
        return Finding("nodes", "; ".join(found))
    what = f"neither a node by rmw_zenoh in domain {domain} nor a {wire.BRIDGE} is there"
    domains = sorted({other for other in _domains(session) if other != domain})
    if domains:
        which = ", ".join(map(str, domains))
        return wrong("nodes", f"{what}, but nodes in domain {which}", f"domain: {domains[0]}  (in the ros2 section)")
    return wrong("nodes", what, CURE)


def _domains(session: Any) -> Iterator[int]:
    for reply in session.liveliness().get(f"{wire.ADMIN}/**", timeout=LISTEN):
        if reply.ok is not None and (found := wire.entity(str(reply.ok.key_expr))) is not None:
            yield found.domain
