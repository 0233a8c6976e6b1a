"""The file of a fleet, ``~/.config/missiontree/fleet.yaml``: where its robots find each other, and by which keys."""

from collections.abc import Iterator
from dataclasses import fields
from ipaddress import ip_address
from pathlib import Path
from typing import Literal

from config.defaults import config_folder
from config.diagnostics import InvalidFileError
from config.fields import fields_of
from config.section_reader import read_keys
from config.yaml_nodes import read_source
from drivers.api.keys import KeyDiagnostic, key, keys

FLEET_FILE = "fleet.yaml"

DEFAULT_PORT = 7450
"""Where the robots of one computer find each other, unless a file says otherwise."""

SECURE_PROTOCOLS = ("tls", "quic")


@keys
class FleetKeys:
    """The keys of the file of a fleet."""

    fleet: str = key(default="home", help="The name of the fleet: robots of another one are not seen.")
    mode: Literal["peer", "client"] = key(
        default="peer",
        help="`peer` speaks with each of the others directly; `client` through a Zenoh router, for more than twenty.",
    )
    listen: tuple[str, ...] = key(default=(), help="Where others reach this computer: `tls/0.0.0.0:7450`.")
    connect: tuple[str, ...] = key(
        default=(), help="Where others are, any of them: `tls/anna.local:7450`. None of them has to be there."
    )
    ca: str = key(default="", help="The certificate (PEM) that has signed those of all in the fleet.")
    certificate: str = key(default="", help="This computer's certificate (PEM).")
    private_key: str = key(default="", help="The private key (PEM) of that certificate.")
    robots: tuple[str, ...] = key(default=(), help="The names of the robots, so that one that is missing is told of.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Find what would be open to a network without keys."""
        for word in ("listen", "connect"):
            for number, endpoint in enumerate(getattr(self, word)):
                if why := refusal_reason(endpoint, certified=bool(self.ca and self.certificate and self.private_key)):
                    yield KeyDiagnostic(why, (word, number), hint=SECURE_ENDPOINT_HINT)


SECURE_ENDPOINT_HINT = (
    "tls/HOST:PORT, with `ca`, `certificate` and `private_key`: docs/fleet.md says how they are made; "
    f"tcp/127.0.0.1:{DEFAULT_PORT} stays on this computer"
)


def refusal_reason(endpoint: str, *, certified: bool) -> str:
    """Return why an endpoint is not used; nothing for one that is within this computer, or secured by keys."""
    protocol, slash, place = endpoint.partition("/")
    host, colon, port = place.partition("#")[0].rpartition(":")
    if not (slash and colon and host and port.isdecimal()) or protocol not in ("tcp", *SECURE_PROTOCOLS):
        return f"'{endpoint}' is no endpoint"
    if protocol in SECURE_PROTOCOLS:
        return "" if certified else f"'{endpoint}' needs the keys of the fleet"
    return "" if _is_loopback(host) else f"'{endpoint}' would be open to the network, without keys"


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def load_fleet(path: Path | None = None) -> FleetKeys:
    """Return the fleet of the file at ``path``, or of the user's; without one, that of this computer alone.

    Files of keys that are named are found beside it. Raises InvalidFileError with every mistake.
    """
    path = config_folder() / FLEET_FILE if path is None else path
    if not path.is_file():
        return FleetKeys()
    section = fields_of(read_source(path), subject="the file of a fleet")
    found = read_keys(section, FleetKeys)
    if section.diagnostics:
        raise InvalidFileError(section.diagnostics)
    values = {each.name: getattr(found, each.name) for each in fields(FleetKeys)}
    for word in ("ca", "certificate", "private_key"):
        values[word] = values[word] and str(path.parent / Path(values[word]).expanduser())
    return FleetKeys(**values)
