"""Words of other languages that people write in missions, and what is meant by a word that nobody knows.

What a word means goes before how it is spelt. A likeness of spelling alone never leads to a behaviour that moves the
robot, but for one slip of the keyboard: a letter missing or too many, two that changed places, and in a long word
another letter. Who writes ``sleep`` is not answered with ``sweep``, which moves a joint.
"""

from collections.abc import Collection, Mapping

from behaviours.leaf import Leaf
from config.faults import did_you_mean, one_slip
from config.synonyms import head_of, in_words, ours_for, plain_word

MOVING = frozenset({"base", "head", "arm"})
"""The actuators that move."""

WORDS: Mapping[str, str] = {
    "wait": "sleep pause wait_for sleep_for delay_for idle",
    "turn": "rotate rotate_in_place",
    "go_to": "goto navigate navigate_to move_to drive_to nav_to",
    "say": "speak tell print tts talk echo_aloud",
    "log": "print echo debug info printf puts",
    "set": "let assign set_blackboard set_variable var variable",
    "find_face": "detect_face look_for_face search_face",
    "succeed": "pass noop nop always_success success do_nothing",
    "fail": "always_failure failure raise abort error",
    "pretend": "mock stub",
    "sequence": "and seq do steps block series serial begin all_of",
    "selector": "or fallback priority any any_of either try alternatives sel first_of",
    "reactive_sequence": "reactive_and",
    "reactive_selector": "reactive_or reactive_fallback reactive_priority",
    "for_each": "foreach for each for_all map loop_over iterate for_in with_items",
    "parallel": "simultaneously together concurrent concurrently at_once parallel_all",
    "switch": "then else elif else_if otherwise case choose match select cond",
    "mission": "call run subtree sub_tree submission include import uses execute start_mission name",
    "repeat": "loop times again forever repeat_forever cycle",
    "repeat: forever": "keep_running_until_failure loop_forever",
    "retry": "retries attempts retry_until_successful tries",
    "if": "when only_if condition precondition",
    "if: not ...": "unless",
    "while": "as_long_as during",
    "timeout": "time_limit timeout_after max_time deadline timeout_seconds",
    "invert: true": "not inverter negate invert_result",
    "on_failure: succeed": "ignore_errors ignore_failure force_success continue_on_error failure_is_success",
    "on_success: fail": "force_failure success_is_failure",
    "once: true": "run_once only_once",
    "delay": "after start_after",
    "cooldown": "throttle rate_limit",
    "as": "register store save result output into keep_as",
    "with": "params args arguments inputs parameters",
    "name": "title label",
    "summary": "description desc about help",
    "params": "parameters args arguments inputs vars variables",
    "tree": "root steps behavior_tree behaviour_tree behavior behaviour nodes do main actions",
    "returns": "outputs output return results",
    "properties": "promises asserts",
}
"""Our words, each with what others call it. What is a word itself, of a package perhaps, never means another."""

LONG = 8
"""Letters of a word that with one other letter is hardly another word: wander and wonder are."""

BRANCHES = "write switch: {on: CONDITION, cases: {true: ..., false: ...}}"


def word_meant(
    word: str, leaves: Mapping[str, type[Leaf]], composites: Collection[str], beside: Collection[str], *, alone: bool
) -> str:
    """Say what may be meant by an unknown word: ours for it, else the closest. Empty where nothing is near.

    ``beside`` are the words that stand beside a behaviour, which are not meant by one that stands ``alone``.
    """
    known = [*leaves, *composites, *([] if alone else beside)]
    if plain_word(word) in known:
        return f"did you mean '{plain_word(word)}'?"
    ours = ours_for(word, WORDS, [*leaves, *composites, *beside])
    if ours == ["switch"]:
        return BRANCHES
    if ours:
        return f"write {in_words(ours)}" + (", beside a behaviour" if head_of(ours[0]) in beside else "")
    return did_you_mean(word, [each for each in known if _may_be_meant(word.lower(), each, leaves)])


def _may_be_meant(word: str, known: str, leaves: Mapping[str, type[Leaf]]) -> bool:
    """Say whether a word may be proposed for its spelling: whatever does not move, and what is one slip away."""
    if known not in leaves or not leaves[known].drives & MOVING:
        return True
    another_letter = len(word) == len(known) and sorted(word) != sorted(known)
    return one_slip(word, known) and not (another_letter and len(word) < LONG)
