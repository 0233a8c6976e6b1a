"""A studio that the tests of this folder share which need none of their own."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from missions.control.run_folders import SYSTEM_ROOT
from tests.missions.studio.serving import Served, studio

RUNTIME = "XDG_RUNTIME_DIR"
"""Where the sockets of runs are: the shared studio sees those of the tests that ask for it, and of no others."""


def live_in(runtime: str, patch: pytest.MonkeyPatch) -> None:
    """Have runs where nobody else looks for them."""
    patch.setenv(RUNTIME, runtime)
    patch.setenv(SYSTEM_ROOT, f"{runtime}/system")


@pytest.fixture(scope="package")
def served(homes: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A studio at a home of its own: what it keeps outlives the tests."""
    del homes
    with ExitStack() as ends:
        with pytest.MonkeyPatch.context() as patch:
            live_in(str(tmp_path_factory.mktemp("studio")), patch)
            found = ends.enter_context(studio())
        yield found
        with pytest.MonkeyPatch.context() as patch:
            live_in(found.runtime, patch)
            ends.close()


@pytest.fixture(scope="package")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate for this computer and for robot.example, and its key."""
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl, to make a certificate")
    folder = tmp_path_factory.mktemp("tls")
    certificate, key = folder / "cert.pem", folder / "key.pem"
    subject = ["-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1,DNS:robot.example"]
    files = ["-keyout", str(key), "-out", str(certificate)]
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", *subject, *files]
    subprocess.run(make, check=True, capture_output=True)
    return certificate, key


@pytest.fixture(autouse=True)
def within_sight_of_its_studio(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the runs of a test where the studio looks that it shares."""
    if "served" in request.fixturenames:
        live_in(request.getfixturevalue("served").runtime, monkeypatch)
