"""Zenoh session as for `rmw_zenoh`: no multicast, a named router, optional TLS and user."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal

from drivers.errors import BadRequest, NotConnected

if TYPE_CHECKING:
    import zenoh

LEASE_MS = 2000
"""Milliseconds without a message after which Zenoh drops a session and its liveliness tokens."""

NO_ROUTER_HINT = (
    "start a router: `ros2 run rmw_zenoh_cpp rmw_zenohd` on the robot, or `zenoh-bridge-ros2dds` for DDS; "
    "then check 'router' in the robot file"
)


@dataclass(frozen=True, slots=True)
class ZenohAccess:
    """Settings of a Zenoh session: addresses such as ``tcp/127.0.0.1:7447``, mode and credentials.

    The session connects to ``endpoints``, and accepts connections at ``listen``. ``user`` and ``password`` are
    credentials for the router. ``ca``, ``certificate`` and ``private_key`` are files: the CA certificate of the router,
    and our own certificate with its key. TLS addresses begin with ``tls/``.
    """

    endpoints: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    mode: Literal["client", "peer", "router"] = "client"
    listen: tuple[str, ...] = ()
    user: str = ""
    password: str = ""
    ca: str = ""
    certificate: str = ""
    private_key: str = ""


def zenoh_access(keys: Any, router: str = "") -> ZenohAccess:
    """Return the settings of a Zenoh session from ``keys``, the ``ros2`` section of a robot file.

    ``router`` replaces the router's address in the robot file unless it is empty. Raises BadRequest for an unreadable
    password file.
    """
    password = ""
    if keys.password_file:
        try:
            password = Path(keys.password_file).expanduser().read_text(encoding="utf-8").split("\n")[0].strip()
        except OSError as error:
            raise BadRequest(f"ros2: password_file {keys.password_file}: {error.strerror}") from error
    return ZenohAccess(
        tuple(each.strip() for each in (router or keys.router).split(",")),
        keys.mode,
        user=keys.user,
        password=password,
        ca=keys.ca,
        certificate=keys.certificate,
        private_key=keys.private_key,
    )


def open_session(part: str, access: ZenohAccess, *, timeout: float = 0.5) -> "zenoh.Session":
    """Open a Zenoh session within ``timeout`` seconds. Raises NotConnected, with a hint; ``part`` is the name in it.

    In the modes ``peer`` and ``router`` this succeeds at once, and the session connects in the background.
    """
    try:
        import zenoh  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise NotConnected(f"{part}: Zenoh is not installed", hint="pip install 'missiontree[ros2]'") from error
    where = ", ".join(access.endpoints or access.listen)
    try:
        return zenoh.open(_config(zenoh, access, timeout))
    except zenoh.ZError as error:
        words = str(error).split(" at /")[0]
        raise NotConnected(f"{part}: {where}: no Zenoh router answers: {words}", hint=NO_ROUTER_HINT) from error


def _config(zenoh: Any, access: ZenohAccess, timeout: float) -> Any:
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": access.mode,
        "connect/endpoints": list(access.endpoints),
        "connect/timeout_ms": round(1000 * timeout) if access.mode == "client" else 0,
        "connect/exit_on_failure": access.mode == "client",
        "listen/endpoints": list(access.listen),
        "scouting/multicast/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "timestamping/enabled": False,
        "transport/shared_memory/enabled": False,  # its files would outlive a crash
    }
    if access.user:
        settings |= {"transport/auth/usrpwd/user": access.user, "transport/auth/usrpwd/password": access.password}
    if access.ca:
        settings["transport/link/tls/root_ca_certificate"] = str(Path(access.ca).expanduser())
    if access.certificate:
        settings |= {
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/connect_certificate": str(Path(access.certificate).expanduser()),
            "transport/link/tls/connect_private_key": str(Path(access.private_key).expanduser()),
        }
    for name, value in settings.items():
        if not (name == "listen/endpoints" and not value and access.mode != "peer"):
            config.insert_json5(name, json.dumps(value))
    return config


class ConnectionMonitor:
    """Counts the connections of a Zenoh session; ``on_disconnect`` is called when none is left.

    It is called on a thread of Zenoh.
    """

    def __init__(self, session: "zenoh.Session", on_disconnect: Callable[[], None]) -> None:
        import zenoh  # noqa: PLC0415 - an extra

        self._put = zenoh.SampleKind.PUT
        self._on_disconnect = on_disconnect
        self._lock = Lock()
        self.count = 0
        self._listener = session.info.declare_transport_events_listener(self._on_event, history=True)

    def _on_event(self, event: "zenoh.TransportEvent") -> None:
        with self._lock:
            self.count += 1 if event.kind == self._put else -1
            alone = self.count <= 0
        if alone:
            self._on_disconnect()
