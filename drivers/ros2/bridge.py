"""Zenoh keys and liveliness tokens of zenoh-bridge-ros2dds, for robots whose ROS 2 uses DDS.

Examples are TurtleBot 4, Create 3, ROS 2 Humble and micro-ROS. The key of a topic is its name without the first "/",
without domain, type and hash. Payloads are CDR without attachments. The bridge announces topics, services and actions
by tokens. See README.md and src/liveliness_mgt.rs of eclipse-zenoh/zenoh-plugin-ros2dds. No I/O.
"""

from drivers.ros2 import wire
from drivers.ros2.wire import BRIDGE, CANCEL, CANCEL_KIND, FEEDBACK, RESULT, SEND, STATUS, Entity

TOKENS = "@/*/@ros2_lv/**"
"""Key expression that matches the liveliness tokens of all bridges.

The token of a bridge itself ends with @ros2_lv; in those of its topics, services and actions more follows.
"""

ACTION_SERVER, ACTION_CLIENT = "AS", "AC"
"""Roles that rmw_zenoh lacks: an action is one entity."""

_SLASH = "§"
_TRANSIENT_LOCAL = "1"
_ROLES = {wire.PUBLISHER, wire.SUBSCRIBER, wire.SERVER, wire.CLIENT, ACTION_SERVER, ACTION_CLIENT}


def service_token(zid: str, name: str, kind: str) -> str | None:
    """Return the token by which session ``zid`` offers the service ``name`` of type ``kind`` to robots behind bridges.

    An action has one token for all of its services and topics: it is returned for the goal service, None for the
    others.
    """
    action, part, end = name.rpartition("/_action/")
    role = wire.SERVER
    if part:
        if end != SEND.rpartition("/")[2]:
            return None
        role, name, kind = ACTION_SERVER, action, kind.removesuffix("_SendGoal")
    return f"@/{zid}/@ros2_lv/{role}/{name.strip('/').replace('/', _SLASH)}/{kind.replace('/', _SLASH)}"


def parse_token(key: str) -> list[Entity]:
    """Return the entities that a bridge announces by a token; an empty list for other tokens.

    The token of an action announces one entity for each of its services and topics.
    """
    parts = key.split("/")
    if len(parts) < 3 or parts[0] != "@" or parts[2] != wire.LIVELINESS_PREFIX:
        return []
    zid, told = parts[1], parts[3:]
    if not told:
        return [_entity(wire.NODE, zid)]
    if len(told) < 3 or told[0] not in _ROLES:
        return []
    role, name, kind = told[0], "/" + told[1].replace(_SLASH, "/"), told[2].replace(_SLASH, "/")
    if not wire.is_name(name) or kind.count("/") != 2:
        return []
    if role in (ACTION_SERVER, ACTION_CLIENT):
        return _action_entities(zid, name, kind, serves=role == ACTION_SERVER)
    durability = "/".join(told[3:]).split(":")[2:3]
    return [_entity(role, zid, name, kind, wire.LATCHED_QOS if durability == [_TRANSIENT_LOCAL] else wire.DEFAULT_QOS)]


def _action_entities(zid: str, name: str, kind: str, *, serves: bool) -> list[Entity]:
    services = {SEND: f"{kind}_SendGoal", RESULT: f"{kind}_GetResult", CANCEL: CANCEL_KIND}
    topics = {FEEDBACK: f"{kind}_FeedbackMessage", STATUS: "action_msgs/msg/GoalStatusArray"}
    asked, heard = (wire.SERVER, wire.PUBLISHER) if serves else (wire.CLIENT, wire.SUBSCRIBER)
    return [
        *(_entity(asked, zid, f"{name}/{part}", of) for part, of in services.items()),
        *(_entity(heard, zid, f"{name}/{part}", of) for part, of in topics.items()),
    ]


def _entity(role: str, zid: str, name: str = "", kind: str = "", qos: str = "") -> Entity:
    return Entity(role, 0, zid, "0", "0", BRIDGE, "", name, kind, BRIDGE, qos)
