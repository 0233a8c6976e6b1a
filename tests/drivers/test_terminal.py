"""The pseudo-terminal as a thing with a life: nothing before it is opened, nothing after it was closed."""

from pathlib import Path

from drivers.clock import ManualClock
from drivers.virtual.rodney import VirtualRodney
from drivers.virtual.terminal import Terminal


def test_it_makes_nothing_before_it_is_opened_and_leaves_nothing_after() -> None:
    terminal = Terminal("nano", VirtualRodney(), ManualClock())
    folder = Path(terminal.path).parent
    assert not folder.exists()
    terminal.close()
    for _ in range(2):
        terminal.open()
        terminal.open()
        assert Path(terminal.path).is_char_device()
        assert folder.stat().st_mode & 0o777 == 0o700
        terminal.close()
        terminal.close()
        assert not folder.exists()
