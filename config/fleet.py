"""Fleet file ``~/.config/missiontree/fleet.yaml``: endpoints and certificates of the fleet."""

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
"""Default TCP port of the fleet, for robots on one computer."""

SECURE_PROTOCOLS = ("tls", "quic")


@keys
class FleetKeys:
    """Keys of the fleet file."""

    fleet: str = key(default="home", help="Name of the fleet; robots of other fleets are not visible.")
    mode: Literal["peer", "client"] = key(
        default="peer",
        help="`peer` connects to each of the others directly; `client` uses a Zenoh router, for more than twenty.",
    )
    listen: tuple[str, ...] = key(default=(), help="Endpoints of this computer: `tls/0.0.0.0:7450`.")
    connect: tuple[str, ...] = key(
        default=(), help="Endpoints of others: `tls/anna.local:7450`. They need not be online."
    )
    ca: str = key(default="", help="Certificate (PEM) of the authority that signed the certificates of the fleet.")
    certificate: str = key(default="", help="Certificate (PEM) of this computer.")
    private_key: str = key(default="", help="Private key (PEM) of that certificate.")
    robots: tuple[str, ...] = key(default=(), help="Names of the robots, so that missing robots are reported.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each endpoint that would be open to the network without certificates."""
        for word in ("listen", "connect"):
            for number, endpoint in enumerate(getattr(self, word)):
                if reason := refusal_reason(
                    endpoint, certified=bool(self.ca and self.certificate and self.private_key)
                ):
                    yield KeyDiagnostic(reason, (word, number), hint=SECURE_ENDPOINT_HINT)


SECURE_ENDPOINT_HINT = (
    "tls/HOST:PORT, with `ca`, `certificate` and `private_key`: docs/fleet.md says how they are made; "
    f"tcp/127.0.0.1:{DEFAULT_PORT} stays on this computer"
)


def refusal_reason(endpoint: str, *, certified: bool) -> str:
    """Return why an endpoint is not used; empty for a loopback endpoint and for one secured by certificates."""
    protocol, slash, place = endpoint.partition("/")
    host, colon, port = place.partition("#")[0].rpartition(":")
    if not (slash and colon and host and port.isdecimal()) or protocol not in ("tcp", *SECURE_PROTOCOLS):
        return f"'{endpoint}' is not an endpoint"
    if protocol in SECURE_PROTOCOLS:
        return "" if certified else f"'{endpoint}' needs the keys of the fleet"
    return "" if _is_loopback(host) else f"'{endpoint}' would be open to the network without encryption"


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def load_fleet(path: Path | None = None) -> FleetKeys:
    """Return the fleet in the file at ``path``, or in the user's file; by default a fleet of this computer alone.

    Certificates are looked up beside the file. Raises InvalidFileError with all errors.
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
