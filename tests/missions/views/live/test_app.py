"""What a view shows of the messages that it gets, and what its keys ask for; no terminal and no run needed."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Sequence

import pytest
from textual.pilot import Pilot
from textual.widgets import RichLog, Static

from drivers.clock import ManualClock
from missions.plugins.view.app import ViewApp
from tests.missions.views.live.messages import Message, first, many, news, part

Use = Callable[["Shown"], Awaitable[None]]


async def settle(_: float = 0.0) -> None:
    """Let everything happen that follows from what happened, whatever time it takes: until the loop has nothing to do.

    A view waits for nothing but timers, messages and keys; this waits for none of them.
    """
    ready = asyncio.get_running_loop()._ready  # type: ignore[attr-defined]
    await asyncio.sleep(0)
    while ready:
        await asyncio.sleep(0)


@pytest.fixture(autouse=True)
def keys_wait_for_what_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where textual guesses from the time on the processor that a key has been taken, know it."""
    monkeypatch.setattr("textual.app.wait_for_idle", settle)


class Shown:
    """A view in use. ``orders`` is all that it has asked for."""

    def __init__(self, *, plain: bool = False) -> None:
        self.orders: list[str] = []
        self.clock = ManualClock()
        self._messages = asyncio.StreamReader(limit=1 << 26)
        self.app = ViewApp(self._messages, self.orders.append, self.clock, plain=plain)
        self.pilot: Pilot[None] | None = None

    async def hear(self, *messages: Message) -> None:
        """Let these messages come."""
        for message in messages:
            self._messages.feed_data(json.dumps(message).encode() + b"\n")
        await self._settle()

    async def press(self, *keys: str) -> None:
        assert self.pilot is not None
        await self.pilot.press(*keys)
        await self._settle()

    async def _settle(self) -> None:
        """Let what was heard and pressed take effect and be painted, which may make more to be laid out and painted."""
        for _ in range(5):
            await settle()
            self.app.screen._on_timer_update()
        await settle()

    def end(self) -> None:
        self._messages.feed_eof()

    def said(self, name: str) -> str:
        """Return what a panel of lines says."""
        return str(self.app.query_one(f"#{name}", Static).content)

    @property
    def tree(self) -> list[str]:
        """The lines of the tree that are not folded away."""
        nodes = self.app.nodes
        found = (nodes.get_node_at_line(line) for line in range(nodes.last_line + 1))
        return [str(node.label) for node in found if node is not None]

    @property
    def screen(self) -> str:
        """All that is on the screen, line by line."""
        size, lines = self.app.size, self.app.screen._compositor.render_strips()
        return "\n".join(strip.text for strip in lines[: size.height])


def use(do: Use, *, size: tuple[int, int] = (140, 45), plain: bool = False) -> None:
    """Show the small mission and do something with that."""

    async def main() -> None:
        shown = Shown(plain=plain)
        async with shown.app.run_test(size=size) as shown.pilot:
            await shown.hear(first(), news())
            await do(shown)

    asyncio.run(main())


def test_tree_shows_status_and_reason_of_each_node() -> None:
    async def do(shown: Shown) -> None:
        changed = {
            "1": ["running", "", 0.0],
            "1.1": ["failure", "timed out after 60 s", 2.0],
            "1.1.1": ["idle", "", 2.0],
            "1.2": ["running", "", 2.0],
            "1.2.1": ["running", "2 of 5 s", 2.0],
        }
        await shown.hear(news(5.5, changed=changed))
        assert shown.tree == [
            "▶ sequence",
            "○ find_face  timed out after 60 s  [✗ timeout: 60 s]",
            "▶ mission: wave",
            "▶ gesture: hello  3 s  2 of 5 s",
            "○ say: [bold]Hello!",
        ]
        await shown.hear(news(6.0, changed={"1.2.1": ["success", "", 6.0]}))
        assert shown.tree[3] == "✓ gesture: hello"

    use(do)


def test_head_line_shows_the_state_of_the_run() -> None:
    async def do(shown: Shown) -> None:
        await shown.hear(news(12.34, lates=3))
        assert shown.said("head").startswith(" greet on turtlebot2_arm ")
        assert shown.said("head").endswith("3 late   tick 246   12.3 s   running ")
        await shown.hear(news(12.34, paused=True))
        assert shown.said("head").endswith("paused ")
        await shown.hear(news(12.34, stopping=True))
        assert shown.said("head").endswith("stopping ")

    use(do)


def test_parts_show_level_age_values_and_hint() -> None:
    async def do(shown: Shown) -> None:
        parts = [
            part("OK", values={"battery": 91.6, "x": -0.001, "heading": 0.5}),
            part("WARN", part="arm", age=0.0, detail="3 replies missed within 2 s"),
            part("STALE", part="head", age=3.26, detail="no new reading"),
            part("ERROR", part="voice", age=None, detail="/dev/snd: no such device", hint="plug it in"),
        ]
        await shown.hear(news(parts=parts))
        assert [line.split() for line in shown.said("parts").splitlines()] == [
            ["✓", "OK", "base", "0.1", "s", "battery", "92", "%", "x", "0.00", "29°"],
            ["!", "WARN", "arm", "0.0", "s", "3", "replies", "missed", "within", "2", "s"],
            ["…", "STALE", "head", "3.3", "s", "no", "new", "reading"],
            ["✗", "ERROR", "voice", "/dev/snd:", "no", "such", "device"],
            ["try:", "plug", "it", "in"],
        ]
        await shown.hear(news(1.0))
        assert "STALE" in shown.said("parts")

    use(do)


def test_variables_are_updated_and_named_with_their_submission() -> None:
    async def do(shown: Shown) -> None:
        await shown.hear(news(variables={"greeting": "Hello!", "1.2 times": "3"}))
        assert shown.said("variables") == "greeting Hello!\nwave: times 3"
        await shown.hear(news(variables={"greeting": None, "1.2 times": "4"}))
        assert shown.said("variables") == "wave: times 4"

    use(do)


def test_log_lines_are_kept_without_interpreting_markup() -> None:
    async def do(shown: Shown) -> None:
        await shown.hear(news(log=["   3.5 s  ✗ find_face  (3.5 s, nobody)", "  robot: [red]hello[/red]"]))
        lines = [strip.text.rstrip() for strip in shown.app.query_one("#log", RichLog).lines]
        assert lines == ["   3.5 s  ✗ find_face  (3.5 s, nobody)", "  robot: [red]hello[/red]"]

    use(do)


def test_keys_send_the_orders_shown_in_the_footer() -> None:
    async def do(shown: Shown) -> None:
        await shown.press("n", "space")
        assert shown.orders == ["pause"]
        assert "n step" not in shown.said("foot")
        await shown.hear(news(paused=True))
        assert "space resume   n step" in shown.said("foot")
        await shown.press("n", "space", "s")
        assert shown.orders[1:] == ["step", "resume", "stop"]

    use(do)


def test_second_stop_and_ctrl_c_interrupt() -> None:
    async def do(shown: Shown) -> None:
        await shown.press("ctrl+c", "ctrl+z", "q", "ctrl+q")
        assert shown.orders == ["interrupt", "interrupt", "stop", "stop"]
        await shown.hear(news(stopping=True))
        await shown.press("s")
        assert shown.orders[4:] == ["interrupt"]

    use(do)


def test_cursor_follows_the_running_node_until_moved() -> None:
    async def do(shown: Shown) -> None:
        await shown.hear(news(changed={"1": ["running", "", 0.0], "1.1.1": ["running", "looking", 0.0]}))
        assert shown.said("about") == (" greet.yaml:4  find_face  {pan: [-60 deg, 60 deg], speed: 20 deg/s}  looking")
        await shown.press("up")
        await shown.hear(news(changed={"1.1.1": ["success", "", 1.0], "1.2.1": ["running", "", 1.0]}))
        assert shown.said("about") == " greet.yaml:3  sequence"
        await shown.press("r")
        assert shown.said("about") == " wave.yaml:3  gesture: hello"

    use(do)


def test_a_search_finds_words_of_a_node_and_keys_are_letters_meanwhile() -> None:
    async def do(shown: Shown) -> None:
        await shown.press("f", "slash", *"s", "n", "space")
        assert shown.tree[2:] == ["○ mission: wave", "○ say: [bold]Hello!"]
        await shown.press(*["backspace"] * 3, *"hello")
        assert shown.said("about") == " wave.yaml:3  gesture: hello"
        await shown.press("enter")
        assert shown.said("about") == " greet.yaml:7  say: [bold]Hello!"
        await shown.press("escape", "space")
        assert shown.orders == ["pause"]

    use(do)


def test_missions_inside_are_folded_and_unfolded() -> None:
    async def do(shown: Shown) -> None:
        everything = shown.tree
        await shown.press("f")
        assert shown.tree == [*everything[:3], everything[4]]
        assert "○ mission: wave  (1 folded)" in shown.screen
        await shown.hear(news(changed={"1.2.1": ["running", "", 0.0]}))
        assert shown.said("about") == " greet.yaml:6  mission: wave"
        await shown.press("f")
        assert len(shown.tree) == 5

    use(do)


def test_large_tree_opens_folded_and_follows_the_running_node() -> None:
    async def main() -> None:
        shown = Shown()
        async with shown.app.run_test(size=(80, 24)) as shown.pilot:
            await shown.hear(first(many(10, 30)))
            assert len(shown.tree) == 11
            await shown.press("f")
            assert len(shown.tree) == 311
            await shown.hear(news(changed={"1.9.30": ["running", "", 0.0]}))
            assert "▶ wait: wait 1.9.30" in shown.screen

    asyncio.run(main())


@pytest.mark.parametrize("size", [(80, 24), (140, 45)])
def test_view_fits_small_and_large_terminals(size: tuple[int, int]) -> None:
    async def do(shown: Shown) -> None:
        await shown.hear(news(parts=[part("OK")], variables={"greeting": "Hi"}, log=["  robot: Hi"]))
        words = (
            "greet on",
            "find_face",
            "greet.yaml:3",
            "robot",
            "✓ OK",
            "variables",
            "greeting Hi",
            "robot: Hi",
            "space",
        )
        assert [word for word in words if word not in shown.screen] == []

    use(do, size=size)


@pytest.mark.parametrize("size", [(80, 24), (140, 45)])
def test_plain_view_is_ascii_only(size: tuple[int, int]) -> None:
    async def do(shown: Shown) -> None:
        changed = {"1": ["running", "", 0.0], "1.1": ["failure", "", 0.0], "1.1.1": ["success", "", 0.0]}
        parts = [part(level, values={"heading": 1.0}) for level in ("OK", "WARN", "ERROR", "STALE")]
        await shown.hear(news(changed=changed, parts=parts, log=["✓ ✗ 5 °C", *["more"] * 60]))
        await shown.press("slash")
        assert {c for c in shown.screen if not c.isascii()} == set()
        assert "+ OK" in shown.screen
        assert "> sequence" in shown.screen

    use(do, size=size, plain=True)


def test_silent_run_is_marked_stale() -> None:
    async def do(shown: Shown) -> None:
        shown.clock.advance(5.0)
        shown.app._show_head()
        assert shown.said("head").endswith("… STALE: no message for 5 s ")

    use(do)


def test_view_ends_when_its_messages_end() -> None:
    async def main() -> Sequence[str]:
        shown = Shown()
        shown.end()
        await asyncio.wait_for(shown.app.run_async(headless=True), 60.0)
        return shown.orders

    assert asyncio.run(main()) == []
