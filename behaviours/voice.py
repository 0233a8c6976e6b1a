"""Leaves that speak."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Utterance


class Say(Leaf):
    """Speak.

    Running until it is spoken, then succeeds. Falls silent when it is halted.
    """

    word = "say"
    needs = frozenset({"voice"})
    drives = frozenset({"voice"})
    text: str = argument("text", "what to say", principal=True)
    _utterance: Utterance | None = None

    def initialise(self) -> None:
        self._utterance = None
        self._utterance = self.robot.voice.say(self.text)

    def update(self) -> Status:
        if self._utterance is not None and self._utterance.done():
            return SUCCESS
        return self.wait(f'saying "{self.text}"')

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._utterance is not None:
            self._utterance.cancel()
