"""Words of other languages that people write in missions, and what is meant by a word that nobody knows.

What a word means goes before how it is spelt. A likeness of spelling alone never leads to a behaviour that moves the
robot, but for one slip of the keyboard: a letter missing or too many, two that changed places, and in a long word
another letter. Who writes ``sleep`` is not answered with ``sweep``, which moves a joint.
"""

from collections.abc import Collection, Mapping
from difflib import SequenceMatcher

from behaviours.leaf import Leaf
from config.faults import did_you_mean, one_slip
from config.synonyms import head_of, in_words, ours_for, plain_word
from drivers.api.kinds import MOVING

WORDS: Mapping[str, str] = {
    "wait": "sleep pause wait_for sleep_for delay_for idle timer wait_seconds",
    "drive: 1 m": "forward forwards move move_forward go_forward drive_forward drive_straight drive_distance "
    "drive_on_heading move_steps",
    "drive: -1 m": "back backward backwards move_back move_backward go_backward drive_backward back_up reverse",
    "turn: 90 deg": "rotate rotate_in_place spin turn_left rotate_left spin_round turn_degrees "
    "turn_anticlockwise turn_counterclockwise",
    "turn: 180 deg": "turn_around turn_back",
    "turn: -90 deg": "turn_right rotate_right turn_clockwise",
    "go_to": "goto navigate_to move_to drive_to nav_to navigate_to_pose goto_pose go_to_pose move_base",
    "velocity": "cmd_vel twist set_velocity set_speed",
    "stop": "halt brake freeze stop_base stop_robot stop_moving emergency_stop",
    "look": "move_head turn_head set_head point_head look_forward",
    "look: 30 deg": "look_left head_left",
    "look: -30 deg": "look_right head_right",
    "nod": "nod_head",
    "move_joints": "move_joint set_joint set_joints move_servo set_servo move_arm",
    "track_face": "follow_face track_person",
    "follow_person": "follow",
    "dock": "go_charge return_to_dock",
    "say": "speak tell print tts talk echo_aloud",
    "sound": "beep tone buzzer",
    "play_sound": "play_audio play_file play_wav",
    "listen": "hear listen_for recognize_speech recognise_speech speech_to_text stt ask ask_for",
    "led": "light set_led lamp",
    "face": "set_face emotion expression show_face smile mood",
    "face_seen": "see_face sees_face face_visible is_face_visible face_detected is_face_seen detect_face person_seen "
    "see_person is_seen see",
    "object_seen": "see_object object_detected detect_object object_visible is_seen see",
    "log": "print echo debug info printf puts",
    "set": "let assign set_blackboard set_variable set_blackboard_variable var variable script",
    "find_face": "look_for_face search_face",
    "succeed": "pass noop nop always_success success do_nothing",
    "fail": "always_failure failure raise abort error",
    "pretend": "mock stub status_queue",
    "sequence": "and seq do steps block series serial begin all_of sequence_with_memory sequence_star",
    "selector": "or fallback priority any any_of either try alternatives sel first_of",
    "reactive_sequence": "reactive_and",
    "reactive_selector": "reactive_or reactive_fallback reactive_priority",
    "for_each": "foreach for each for_all map loop_over iterate for_in with_items",
    "parallel": "simultaneously together concurrent concurrently at_once parallel_all",
    "switch": "then else elif else_if otherwise case choose match select cond if_else if_then_else "
    "switch2 switch3 switch4",
    "reactive_switch": "while_do_else",
    "mission": "call run subtree sub_tree submission include import uses execute start_mission name",
    "repeat": "loop times again forever repeat_forever cycle",
    "repeat: forever": "keep_running_until_failure loop_forever success_is_running",
    "retry": "retries attempts retry_until_successful retry_node tries",
    "if": "when only_if condition precondition check_blackboard_variable_value",
    "if: not ...": "unless",
    "while": "as_long_as during do_while eternal_guard",
    "until": "repeat_until wait_until do_until wait_for_blackboard_variable",
    "timeout": "time_limit timeout_after max_time deadline timeout_seconds",
    "invert: true": "not inverter negate invert_result",
    "on_failure: succeed": "ignore_errors ignore_failure force_success continue_on_error failure_is_success",
    "on_success: fail": "force_failure success_is_failure",
    "once: true": "run_once only_once one_shot",
    "on_running: fail": "running_is_failure",
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
"""Our words, each with what others call it, and with an argument where that is part of the meaning.

A word itself, of a package perhaps, never means another. Only a word that names a motion leads to one.
"""

LIKE = 0.7
"""How much of two words must be alike for the one to be meant by the other."""

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
    if plain_word(word) in beside:
        return f"'{plain_word(word)}' stands beside a behaviour, below it and without a dash"
    ours = ours_for(word, WORDS, [*leaves, *composites, *beside])
    if ours == ["switch"]:
        return BRANCHES
    if ours:
        return f"write {in_words(ours)}" + (", beside a behaviour" if head_of(ours[0]) in beside else "")
    return did_you_mean(word, [each for each in known if _may_be_meant(word.lower(), each, leaves)])


def _may_be_meant(word: str, known: str, leaves: Mapping[str, type[Leaf]]) -> bool:
    """Say whether a word may be proposed for its spelling: what is like it and does not move, or is one slip away."""
    if not known.startswith(word) and SequenceMatcher(None, word, known).ratio() < LIKE:
        return False
    if known not in leaves or not leaves[known].drives.intersection(MOVING):
        return True
    another_letter = len(word) == len(known) and sorted(word) != sorted(known)
    return one_slip(word, known) and not (another_letter and len(word) < LONG)
