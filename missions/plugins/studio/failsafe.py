"""Answers to the command `failsafe`: reactions of a base to faults, simulated with the code that guards real bases."""

from collections.abc import Callable, Mapping
from dataclasses import asdict

from config.diagnostics import did_you_mean
from missions.control.commands import BadMessage, ClientCommand
from missions.plugins.studio.studio_commands import FailsafeQuery
from missions.plugins.testing.failsafe.scenario import CHOICES, ROBOT, FailsafeSetting, run_scenario
from missions.plugins.testing.failsafe.scenario_text import distinct_moments

Json = dict[str, object]

FIRST_CHOICES: Mapping[str, str] = {"fault": "bumper left"}
"""Choices of the failsafe view that are shown first, by field; by default the first of ``CHOICES``.

Without a fault there is nothing to see.
"""


def answer_failsafe(command: ClientCommand) -> Json:
    """Return the answer to `failsafe`. Raises BadMessage for a field that is not one of the available choices."""
    query = command if isinstance(command, FailsafeQuery) else FailsafeQuery()
    chosen = {name: getattr(query, name) or FIRST_CHOICES.get(name, words[0]) for name, words in CHOICES.items()}
    for name, word in chosen.items():
        if word not in CHOICES[name]:
            hint = did_you_mean(word, CHOICES[name]) or f"one of: {', '.join(CHOICES[name])}"
            raise BadMessage("bad_field", f"'{name}' cannot be {word[:60]!r}", hint)
    moments = [
        {**asdict(each), "words": words} for each, words in distinct_moments(run_scenario(FailsafeSetting(**chosen)))
    ]
    return {"robot": ROBOT, "choices": CHOICES, "chosen": chosen, "moments": moments}


HANDLERS: Mapping[str, Callable[[ClientCommand], Json]] = {"failsafe": answer_failsafe}
"""Handlers of commands, by the command's word: here only `failsafe`."""
