"""The sockets and notes of a run: what is missing, or is another's, is made anew, elsewhere where need be."""

import errno
import os
import selectors
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from missions.control import abstract_sockets, sockets
from missions.control.control import CHECK_INTERVAL, LISTENER_KEY, Endpoint
from missions.control.messages import RunMessage
from missions.control.run_folders import run_folders
from tests.missions.studio.running import found_of


def run_id() -> str:
    """Return the name of the run; not a constant, since workers are forked after the tests were collected."""
    return str(os.getpid())


@pytest.fixture
def found() -> Iterator[Endpoint]:
    selector = selectors.DefaultSelector()
    made = Endpoint(
        selector, RunMessage(run=run_id(), pid=os.getpid(), mission="m", robot="r", simulated="", began=0.0)
    )
    made.run_due_checks(0.0)
    assert made.trouble == ""
    yield made
    made.close()
    selector.close()
    assert found_of(os.getpid()) == []


def addresses() -> list[str]:
    (run,) = found_of(os.getpid())
    return [str(each) for each in run.addresses]


def answers(where: sockets.Address, run: Endpoint) -> bool:
    """Whether a connection reaches a listener of the run."""
    with sockets.connect(where) as connection:
        for listener in run.listeners:
            try:
                accepted, _ = listener.accept()
            except BlockingIOError:
                continue
            with accepted:
                accepted.sendall(b"x")
                if connection.recv(1) == b"x":
                    return True
    return False


def drain(run: Endpoint) -> None:
    """Take the looks of a run at itself from its sockets."""
    for listener in run.listeners:
        try:
            while True:
                accepted, peer = listener.accept()
                assert run.is_probe(peer)
                accepted.close()
        except BlockingIOError:
            continue


def test_a_run_has_a_socket_file_an_abstract_socket_and_notes_in_all_folders(
    found: Endpoint,  # noqa: ARG001 - which has made them
) -> None:
    assert addresses() == [
        str(sockets.socket_path(run_id())),
        abstract_sockets.make_name(run_id(), "run", simulated=False).address,
    ]
    assert all((place.folder / f"{run_id()}.note").exists() for place in run_folders())


@pytest.mark.parametrize("what", ["sock", "note"])
def test_removed_endpoint_file_is_created_again(found: Endpoint, what: str) -> None:
    for place in run_folders():
        (place.folder / f"{run_id()}.{what}").unlink(missing_ok=True)
    found.run_due_checks(CHECK_INTERVAL)
    drain(found)
    assert (sockets.socket_folder() / f"{run_id()}.{what}").exists()
    assert answers(sockets.socket_path(run_id()), found)


def test_removed_folder_is_created_again_or_replaced(found: Endpoint) -> None:
    first, second = run_folders()[:2]
    shutil.rmtree(first.folder)
    found.run_due_checks(CHECK_INTERVAL)
    assert (first.folder / f"{run_id()}.sock").exists()
    drain(found)
    shutil.rmtree(first.folder)
    first.folder.write_text("in the way", encoding="utf-8")
    found.run_due_checks(2 * CHECK_INTERVAL)
    drain(found)
    assert answers(second.folder / f"{run_id()}.sock", found)
    assert str(second.folder / f"{run_id()}.sock") in addresses()
    assert found.trouble == ""
    first.folder.unlink()


def test_foreign_socket_at_the_endpoint_path_is_replaced(found: Endpoint) -> None:
    path = sockets.socket_path(run_id())
    path.unlink()
    with socket.socket(socket.AF_UNIX) as thief:
        thief.bind(str(path))
        thief.listen()
        found.run_due_checks(CHECK_INTERVAL)
        drain(found)
        assert answers(path, found)


def test_closed_listener_is_replaced(found: Endpoint) -> None:
    for listener in found.listeners:
        listener.shutdown(socket.SHUT_RDWR)
    found.run_due_checks(CHECK_INTERVAL)
    drain(found)
    assert answers(sockets.socket_path(run_id()), found)


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.EAGAIN])
def test_failed_check_keeps_the_listeners(found: Endpoint, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    before = found.listeners

    def refuse(*_: object) -> socket.socket:
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr("missions.control.control.socket.socket", refuse)
        found.run_due_checks(CHECK_INTERVAL)
    assert found.listeners == before
    drain(found)
    assert answers(sockets.socket_path(run_id()), found)


def test_full_disk_is_reported_until_space_is_free(found: Endpoint, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    for place in run_folders():
        shutil.rmtree(place.folder, ignore_errors=True)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "mkdir", full)
        found.run_due_checks(CHECK_INTERVAL)
        assert "No space left on device" in found.trouble
        drain(found)
        assert answers(
            abstract_sockets.make_name(run_id(), "run", simulated=False).address, found
        )  # which needs no disk
    found.run_due_checks(2 * CHECK_INTERVAL)
    assert found.trouble == ""


def test_selector_watches_the_current_listeners(found: Endpoint) -> None:
    sockets.socket_path(run_id()).unlink()
    found.run_due_checks(CHECK_INTERVAL)
    registered = {key.fileobj for key in found._selector.get_map().values() if key.data is LISTENER_KEY}
    assert registered == set(found.listeners)
    found.pause_accepting(found.listeners[0], CHECK_INTERVAL)
    assert len(found._selector.get_map()) == 1
    found.run_due_checks(found.due)
    assert len(found._selector.get_map()) == 2
