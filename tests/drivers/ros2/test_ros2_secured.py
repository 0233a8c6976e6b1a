"""A router of Zenoh that wants certificates, and a user with a password: who has them gets in, and nobody else."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from config.diagnostics import SourceText
from drivers.api.driver import DriverContext
from drivers.clock import SystemClock
from drivers.ros2.declared import ZenohKeys
from drivers.ros2.graph import Ros2Graph
from drivers.ros2.make import graph as make_graph
from drivers.ros2.virtual import free_address
from missions.library.drivers import parse_robot
from tests.certificates import authority, certificate
from tests.waiting import wait_until

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl, to make certificates"),
]

ROUTER = Path(__file__).parents[2] / "other_programs" / "zenoh_router.py"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the certificates of a router, of a laptop, and of a stranger with another authority."""
    made = tmp_path_factory.mktemp("keys")
    for name in ("robots", "others"):
        authority(made, name)
    certificate(made, "router", "robots", "DNS:localhost,IP:127.0.0.1")
    certificate(made, "laptop", "robots")
    certificate(made, "stranger", "others")
    (made / "users").write_text("anna:secret\n", encoding="utf-8")
    (made / "password").write_text("secret\n", encoding="utf-8")
    (made / "wrong").write_text("guessed\n", encoding="utf-8")
    return made


@contextmanager
def routed(folder: Path, settings: Mapping[str, Any]) -> Iterator[str]:
    """Run a router in a process of its own; yield its address."""
    address = free_address().replace("tcp", "tls")
    tls = {
        "root_ca_certificate": str(folder / "robots.pem"),
        "listen_certificate": str(folder / "router.pem"),
        "listen_private_key": str(folder / "router.key"),
        **settings.get("tls", {}),
    }
    transport = {"link": {"tls": tls}, "auth": settings.get("auth", {})}
    config = {"mode": "router", "listen": {"endpoints": [address]}, "scouting": {"multicast": {"enabled": False}}}
    file = folder / "router.json5"
    file.write_text(json.dumps({**config, "transport": transport}), encoding="utf-8")
    command = [sys.executable, str(ROUTER), str(file)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        try:
            yield address
        finally:
            process.communicate()


@contextmanager
def nodes(text: str) -> Iterator[Ros2Graph]:
    """Open the nodes of a robot whose file says so of them."""
    keys = parse_robot(SourceText("robot.yaml", f"robot: r\nros2:\n{text}")).keys(ZenohKeys)
    assert keys is not None
    graph = make_graph(keys, DriverContext(SystemClock()))
    graph.open()
    try:
        yield graph
    finally:
        graph.close()


def test_router_with_mtls_needs_a_certificate_of_its_authority(folder: Path) -> None:
    with routed(folder, {"tls": {"enable_mtls": True}}) as address:
        trusting = f"  router: {address}\n  ca: {folder}/robots.pem\n"

        def shown(name: str) -> str:
            return f"  certificate: {folder}/{name}.pem\n  private_key: {folder}/{name}.key\n"

        with nodes(trusting + shown("laptop")) as graph:
            wait_until(lambda: graph.health().online)
            graph.publish("/said", "std_msgs/msg/String", '{"data": "hello"}')
        for refused in (trusting + shown("stranger"), trusting):
            _stays_out(refused)
        _stays_out(f"  router: {address}\n  ca: {folder}/others.pem\n" + shown("laptop"))


def test_router_with_users_needs_the_right_password(folder: Path) -> None:
    users = {"usrpwd": {"user": "router", "password": "its own", "dictionary_file": str(folder / "users")}}
    with routed(folder, {"auth": users}) as address:
        trusting = f"  router: {address}\n  ca: {folder}/robots.pem\n"
        with nodes(f"{trusting}  user: anna\n  password_file: {folder}/password\n") as graph:
            wait_until(lambda: graph.health().online)
        for wrong in (
            f"  user: anna\n  password_file: {folder}/wrong\n",
            f"  user: bob\n  password_file: {folder}/password\n",
        ):
            _stays_out(trusting + wrong)
        _stays_out(trusting)


def _stays_out(text: str) -> None:
    """Be told why."""
    with nodes(text) as graph:
        wait_until(lambda: "no Zenoh router answers" in graph.health().detail)
        assert not graph.health().online
        assert graph.health().hint
        assert graph.health().counters["sessions"] == 0
