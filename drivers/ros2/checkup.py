"""Check-up of the Zenoh router of a robot with ROS 2 that uses rmw_zenoh, or a bridge from DDS."""

from collections.abc import Iterator
from threading import Event
from typing import Any

from drivers.api.driver import DriverContext, Finding, failure
from drivers.ros2 import wire
from drivers.ros2.declared import ZenohKeys
from drivers.ros2.make import ros_domain
from drivers.ros2.node import Ros2Node
from drivers.ros2.session import NO_ROUTER_HINT, open_session, zenoh_access

DISCOVERY_TIME = 1.0
"""Seconds in which nodes and bridges announce themselves."""

NO_NODES_HINT = (
    "start nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp (Jazzy and newer), or on the robot `zenoh-bridge-ros2dds`, "
    "whose version must be 1.0 or newer  (docs/ros2.md)"
)


def checkup(keys: ZenohKeys, site: DriverContext) -> Iterator[Finding]:
    """Open a Zenoh session for a short time, and yield findings on the router and the ROS 2 nodes.

    Raises NotConnected, with a hint.
    """
    access, domain = zenoh_access(keys, site.port), ros_domain(keys)
    where = ", ".join(access.endpoints)
    session: Any = open_session("ros2", access, timeout=2.0)
    try:
        node = Ros2Node(session, site.clock, domain=domain, name="mission_checkup")
        Event().wait(DISCOVERY_TIME)
        if not (session.info.routers_zid() or session.info.peers_zid()):
            yield failure("router", f"{where}: no Zenoh router answers", NO_ROUTER_HINT)
            return
        yield Finding("router", f"{where} replies")
        yield _check_nodes(node, session, domain)
        node.close()
    finally:
        session.close()


def _check_nodes(node: Ros2Node, session: Any, domain: int) -> Finding:
    everybody = node.entities()
    nodes = sum(each.role == wire.NODE and not each.is_bridged for each in everybody)
    behind = {each.name for each in everybody if each.is_bridged and each.role != wire.NODE}
    found = [f"{nodes} node{'s' * (nodes != 1)} with rmw_zenoh in domain {domain}"] * bool(nodes)
    if node.has_bridge:
        found.append(f"{wire.BRIDGE} with {len(behind)} topics and services, which has its own domain")
    if found:
        return Finding("nodes", "; ".join(found))
    what = f"no rmw_zenoh node in domain {domain} and no {wire.BRIDGE} found"
    domains = sorted({other for other in _find_domains(session) if other != domain})
    if domains:
        which = ", ".join(map(str, domains))
        return failure("nodes", f"{what}, but nodes in domain {which}", f"domain: {domains[0]}  (in the ros2 section)")
    return failure("nodes", what, NO_NODES_HINT)


def _find_domains(session: Any) -> Iterator[int]:
    for reply in session.liveliness().get(f"{wire.LIVELINESS_PREFIX}/**", timeout=DISCOVERY_TIME):
        if reply.ok is not None and (found := wire.parse_entity(str(reply.ok.key_expr))) is not None:
            yield found.domain
