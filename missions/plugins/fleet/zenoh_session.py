"""Zenoh session of a robot or operator: over TLS with certificates, or without them among programs of this computer."""

import json
import socket
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from config.fleet import DEFAULT_PORT, FleetKeys, refusal_reason
from missions.plugins.fleet.messages import NAME_PATTERN
from missions.plugins.tasks.task import TaskError

if TYPE_CHECKING:
    import zenoh

LINK_LEASE_MS = 1500
"""Milliseconds of silence after which a Zenoh link counts as broken; four keep-alives are sent within it."""

MAX_TRANSPORT_BYTES = 4 * 1024 * 1024
"""Maximum size of a reassembled Zenoh message in bytes."""

INSTALL = "pip install 'missiontree[fleet]'"


def check_name(name: str, what: str = "fleet") -> str:
    """Return a valid name of a fleet or robot. Raises TaskError for a name that cannot be part of a key."""
    if not NAME_PATTERN.fullmatch(name):
        rule = "use up to 40 of: small letters, digits, - and _"
        raise TaskError(f"{ascii(name)[:60]} is not a valid {what} name: {rule}", hint=f"a name such as {what}1")
    return name


def open_session(fleet: FleetKeys, *, mode: str = "") -> "zenoh.Session":
    """Return a session in a fleet; other members are found in the background. Raises TaskError."""
    try:
        import zenoh  # noqa: PLC0415 - the extra may be missing
    except ImportError as error:
        raise TaskError("a fleet needs the package eclipse-zenoh", hint=INSTALL) from error
    certified = bool(fleet.ca and fleet.certificate and fleet.private_key)
    for endpoint in (*fleet.listen, *fleet.connect):
        if why := refusal_reason(endpoint, certified=certified):
            raise TaskError(why, hint="tls/HOST:PORT with keys (docs/fleet.md), or tcp/127.0.0.1:PORT")
    config = zenoh.Config()
    for path, value in _zenoh_settings(fleet, mode or fleet.mode).items():
        config.insert_json5(path, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        where = ", ".join((*fleet.listen, *fleet.connect)) or "this computer"
        raise TaskError(f"fleet '{fleet.fleet}' at {where}: {str(error)[:300]}", hint="docs/fleet.md") from error


def _zenoh_settings(fleet: FleetKeys, mode: str) -> Mapping[str, Any]:
    """Return the Zenoh configuration of a participant of the fleet.

    If fleet.yaml has no addresses, the fleet is limited to programs on this computer.
    """
    listen, connect = list(fleet.listen), list(fleet.connect)
    if not listen and not connect:
        connect = [f"tcp/127.0.0.1:{DEFAULT_PORT}"]
    if not listen and mode == "peer":
        here = not any(each.partition("/")[0] in ("tls", "quic") for each in connect)
        first = f"tcp/127.0.0.1:{DEFAULT_PORT}"
        listen = [first if first in connect and _is_free(DEFAULT_PORT) else "tcp/127.0.0.1:0"] if here else []
    found: dict[str, Any] = {
        "mode": mode,
        "listen/endpoints": listen,
        "listen/exit_on_failure": True,
        "connect/endpoints": connect,
        "connect/timeout_ms": -1 if mode == "client" else 0,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,  # members come from the file, not from multicast
        "transport/shared_memory/enabled": False,
        "transport/link/rx/max_message_size": MAX_TRANSPORT_BYTES,
        "transport/link/tx/lease": LINK_LEASE_MS,
        "transport/link/tx/keep_alive": 4,
    }
    if fleet.ca:
        found["transport/link/tls"] = {
            "root_ca_certificate": fleet.ca,
            "enable_mtls": True,
            "listen_certificate": fleet.certificate,
            "listen_private_key": fleet.private_key,
            "connect_certificate": fleet.certificate,
            "connect_private_key": fleet.private_key,
            "verify_name_on_connect": False,  # the fleet's own CA authenticates members; addresses change
        }
    return found


def _is_free(port: int) -> bool:
    """Return whether a port of this computer is free.

    The first program listens at the default port, and all others connect to it.
    """
    with socket.socket() as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
