"""The leaf that tells somebody who is not there."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument


class Notify(Leaf):
    """Tell whoever gave the task: a line on the terminal, or a notice the way that the robot file says.

    Succeeds at once; the notice is delivered later, as often as that must be tried.
    """

    word = "notify"
    ends = frozenset({"success"})
    instant = True
    text: str = argument("text", "what to tell", principal=True)

    def update(self) -> Status:
        self.run.notify(self.text)
        self.feedback_message = self.text
        return SUCCESS
