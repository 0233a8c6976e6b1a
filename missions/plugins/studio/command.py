"""``mission studio``: a page in the browser to see, start, drive and stop the runs of this user."""

import ipaddress
import os
import resource
import socket
import sys
from contextlib import closing, suppress
from errno import EADDRINUSE, EADDRNOTAVAIL
from pathlib import Path
from ssl import SSLError

import click

from drivers.transport.programs import end_command, tcp_holders
from missions.cli.numbers import WholeNumber
from missions.cli.root import SUCCESS
from missions.plugins.records import retention
from missions.plugins.records.options import is_recorded_by_default

DEFAULT_PORT = 8642

MAX_PORTS_TRIED = 20
"""Number of ports that are tried, from the default port on, if the user names none."""


MIN_DESCRIPTORS = 128
"""Minimum limit of open files for a studio: 64 are reserved for stops, and the rest must suffice for clients."""


@click.command(epilog="Example: mission studio --open")
@click.option(
    "--port",
    type=WholeNumber(min=0, max=65535),
    help=f"Port, 0 for any free one; {DEFAULT_PORT} by default, or the next free one.",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Address to serve at: by default this computer only; 0.0.0.0 for the whole network.",
)
@click.option("--name", "names", multiple=True, metavar="NAME", help="Additional host name that browsers may use.")
@click.option("--open", "in_browser", is_flag=True, help="Open the page in the browser.")
@click.option(
    "--record/--no-record",
    default=None,
    help="Record the runs that it starts, also simulated ones; the default unless defaults.yaml has `record: false`.",
)
@click.option(
    "--records",
    type=click.Path(exists=True, file_okay=False, resolve_path=True, path_type=Path),
    metavar="FOLDER",
    expose_value=False,
    callback=lambda _context, _option, folder: (
        folder and os.environ.update({retention.STUDIO_RECORDS_VARIABLE: str(folder)})
    ),
    help="Folder of the records that it shows; runs that it starts are always stored in the default folder.",
)
@click.option(
    "--certificate",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="TLS certificate: a PEM file.",
)
@click.option(
    "--key",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Private key of the certificate.",
)
@click.option(
    "--leash", type=WholeNumber(), hidden=True, help="File descriptor of a pipe; the studio ends when it closes."
)
@click.option(
    "--keep-tokens", is_flag=True, help="Reuse the tokens of the last studio, so that links and bookmarks stay valid."
)
def command(
    port: int | None,
    host: str,
    names: tuple[str, ...],
    in_browser: bool,
    record: bool | None,
    certificate: Path | None,
    key: Path | None,
    leash: int | None,
    keep_tokens: bool,
) -> int:
    """Serve a page to see, start, drive and stop robots, for browsers on this computer or on the network.

    It prints two links: the first signs in an operator, the second a viewer, who may only watch and stop. Runs
    go on when the studio ends. Runs started in other terminals are shown too.
    """
    try:
        from missions.plugins.studio import access as tokens  # noqa: PLC0415
        from missions.plugins.studio.access import StudioAccess  # noqa: PLC0415 - the extra may be missing
        from missions.plugins.studio.page_opener import page_opener  # noqa: PLC0415
        from missions.plugins.studio.web_server import StudioAddress, serve  # noqa: PLC0415
    except ImportError as error:
        raise click.UsageError(f"the studio needs {error.name}\n  try: pip install 'missiontree[studio]'") from error
    if key is not None and certificate is None:
        raise click.UsageError("--key needs --certificate FILE")
    _check_descriptors()
    access = StudioAccess(*tokens.load_tokens(), save=tokens.save_tokens) if keep_tokens else StudioAccess()
    listener = _listen(host, port)
    with closing(listener):
        kept = is_recorded_by_default() if record is None else record
        place = StudioAddress(host, listener.getsockname()[1], names, certificate, key, kept, access, leash)

        def begun() -> None:
            link = place.link(access.operator)
            click.echo(f"studio: {link}")
            click.echo(f"to view and stop only: {place.link(access.viewer)}")
            if _is_loopback(host):
                click.echo("these links work on this computer only; for others: mission studio --host 0.0.0.0")
            else:
                _show_code(link)
                if certificate is None:
                    click.echo("without TLS, others on this network can read the link (--certificate FILE)", err=True)
            if in_browser:
                opener.open()

        def report(text: str) -> None:
            click.echo(text, err=True)

        try:
            with page_opener(access, place.link, report) as opener:
                running = serve(place, [listener], begun)
        except (SSLError, OSError) as error:
            raise click.ClickException(f"{certificate or host}: {error}") from error
    if running:
        click.echo(f"still running: {', '.join(map(str, running))}\n  try: mission stop --end")
    return SUCCESS


def _check_descriptors() -> None:
    """Raise ClickException if the limit of open files of this process is too low to serve clients."""
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit != resource.RLIM_INFINITY and limit < MIN_DESCRIPTORS:
        few = f"open files are limited to {limit}; the studio needs at least {MIN_DESCRIPTORS}"
        raise click.ClickException(f"{few}\n  try: ulimit -n 1024  (in this shell)")


def _listen(host: str, port: int | None) -> socket.socket:
    """Return a socket that listens at ``port``, or at the default port or the next free one. Raises ClickException."""
    from missions.plugins.studio.web_server import StudioAddress, open_listener  # noqa: PLC0415

    tried = range(DEFAULT_PORT, DEFAULT_PORT + MAX_PORTS_TRIED) if port is None else [port]
    for each in tried:
        try:
            found = open_listener(StudioAddress(host, each))
        except OSError as error:
            if error.errno != EADDRINUSE:
                hint = "another --port" if each and error.errno != EADDRNOTAVAIL else "another --host"
                raise click.ClickException(f"{host} port {each}: {error.strerror or error}\n  try: {hint}") from error
        else:
            if each not in (DEFAULT_PORT, port):
                click.echo(
                    f"port {DEFAULT_PORT} is in use{_port_holders(DEFAULT_PORT)[0]}: this studio is at port {each}",
                    err=True,
                )
            return found
    who, ends = _port_holders(tried[0])
    cure = f"mission studio --port 0  (any free port){ends}"
    raise click.ClickException(f"{host} port {tried[0]}: in use{who}\n  try: {cure}")


def _port_holders(port: int) -> tuple[str, str]:
    """Return the programs that hold a port and the command that ends them; empty texts if unknown."""
    holders = tcp_holders(port)
    ends = end_command(holders, "")
    return f" by {', '.join(map(str, holders))}" if holders else "", f"; or: {ends}" if ends else ""


def _is_loopback(host: str) -> bool:
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def _show_code(link: str) -> None:
    """Print a link as a QR code for the camera of a phone."""
    import segno  # noqa: PLC0415 - rarely needed

    if sys.stdout.isatty():
        segno.make(link, error="m").terminal(compact=True)
