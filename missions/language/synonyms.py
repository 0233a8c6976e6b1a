"""Synonyms: words of other systems in missions, and "did you mean" for unknown words.

An unknown word is first looked up as a synonym; only then is a word with a similar spelling suggested. Some words of
other systems need more than one word of ours: ``PHRASE_SYNONYMS`` has the form to write. ``UNMATCHED_WORDS`` have no
equivalent; the suggestion is a page that compares the systems.

Similar spelling alone never suggests a behaviour that moves the robot, a condition, or a word that changes the flow,
unless it is a typing error. So ``sleep`` does not suggest ``sweep``, which moves a joint, nor ``undocked`` ``docked``.
"""

from collections.abc import Collection, Mapping
from difflib import SequenceMatcher

from behaviours.leaf import Leaf
from config.diagnostics import alternatives_text, did_you_mean, is_one_edit, key_of, own_words_for, to_snake_case
from drivers.api.kinds import ACTUATOR_KINDS

SYNONYMS: Mapping[str, str] = {
    "wait": "sleep pause sleep_for delay_for idle timer wait_seconds",
    "drive: 1 m": "forward forwards move move_forward go_forward drive_forward drive_straight drive_distance "
    "drive_on_heading move_steps",
    "drive: -1 m": "back backward backwards move_back move_backward go_backward drive_backward back_up reverse",
    "turn: 90 deg": "rotate rotate_in_place spin turn_left rotate_left spin_round turn_degrees "
    "turn_anticlockwise turn_counterclockwise",
    "turn: 180 deg": "turn_around turn_back",
    "turn: -90 deg": "turn_right rotate_right turn_clockwise",
    "go_to": "goto move_to drive_to goto_pose go_to_pose",
    "velocity": "cmd_vel twist set_velocity set_speed",
    "stop": "brake freeze stop_base stop_robot stop_moving",
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
    "listen": "hear listen_for recognize_speech recognise_speech speech_to_text stt",
    "led": "light set_led lamp",
    "face": "set_face emotion expression show_face smile mood",
    "face_seen": "see_face sees_face face_visible is_face_visible face_detected is_face_seen detect_face person_seen "
    "see_person is_seen see",
    "object_seen": "see_object object_detected detect_object object_visible is_seen see",
    "log": "print echo debug info printf puts",
    "set": "let assign set_blackboard set_variable set_blackboard_variable var variable script",
    "find_face": "look_for_face search_face",
    "succeed": "pass noop nop always_success success do_nothing",
    "set: {NAME: null}": "unset_blackboard unset_blackboard_variable unset",
    "fail": "always_failure failure raise error",
    "pretend": "mock stub status_queue",
    "sequence": "and seq do steps block series serial begin all_of async_sequence mem_sequence memory_sequence",
    "selector": "or fallback priority any any_of either alternatives sel first_of async_fallback fallback_star "
    "mem_priority mem_selector",
    "reactive_sequence": "reactive_and",
    "reactive_selector": "reactive_or reactive_fallback reactive_priority priority",
    "for_each": "foreach each for_all map loop_over iterate for_in with_items",
    "parallel": "simultaneously together concurrent concurrently at_once",
    "switch": "then else elif else_if otherwise case choose match select cond if_else if_then_else",
    "reactive_switch": "while_do_else",
    "mission": "call run subtree sub_tree sub_tree_plus submission include import uses execute start_mission name",
    "repeat": "loop times again cycle num_cycles num_success",
    "repeat: forever": "forever repeat_forever keep_running_until_failure loop_forever success_is_running "
    "repeat_until_failure",
    "retry": "retries attempts retry_until_successful retry_until_succesful retry_node tries max_attempts num_attempts "
    "num_failures",
    "recover": "recover_with on_retry before_retry between_attempts recovery_action recovery_behavior",
    "finally": "on_exit exit_action on_end at_end at_exit cleanup clean_up teardown tear_down finalize finalise ensure "
    "defer run_always",
    "retry: forever": "retry_forever retry_until_success repeat_until_success failure_is_running",
    "if": "when only_if",
    "if: not (...)": "unless if_not not_if skip_if",
    "while": "as_long_as during eternal_guard guard",
    "while: not (...)": "while_not",
    "until: not (...)": "until_not",
    "timeout": "time_limit timeout_after max_time deadline timeout_seconds",
    "invert: true": "not inverter negate invert_result",
    "on_failure: succeed": "ignore_errors ignore_failure force_success continue_on_error failure_is_success",
    "on_success: fail": "force_failure success_is_failure",
    "once: true": "only_once one_shot oneshot",
    "on_running: fail": "running_is_failure",
    "on_running: succeed": "running_is_success",
    "delay": "after start_after",
    "success_count": "success_threshold",
    "failure_count": "failure_threshold",
    "as": "register store save result output into keep_as",
    "with": "params args arguments inputs parameters",
    "name": "title label",
    "summary": "description desc about help",
    "params": "parameters args arguments inputs vars variables",
    "tree": "root steps behavior_tree behaviour_tree behavior behaviour nodes do main actions",
    "returns": "outputs output return results",
    "properties": "promises asserts",
}
"""Our words, each with the words of other systems that mean the same.

A word of ours has an argument if the meaning needs it, such as ``turn: -90 deg`` for ``turn_right``. A synonym is not
used if it is the tag of an existing leaf. Behaviours that move are suggested only for words that mean motion.
"""

PHRASE_SYNONYMS: Mapping[str, str] = {
    "{check: CONDITION}": "condition check_condition script_condition check_blackboard_variable_value "
    "check_blackboard_variable_exists check_blackboard assert require verify",
    "{sequence: [{check: CONDITION}, BEHAVIOUR]}": "precondition",
    "{wait_until: CONDITION}": "wait_for_condition wait_for_blackboard_variable wait_for_blackboard_variable_value "
    "wait_template",
    "{wait_for: BEHAVIOUR}": "wait_for_success until_success",
    "{BEHAVIOUR: , for: 10 s}": "run_for for_duration",
    "{parallel: [BEHAVIOUR, BEHAVIOUR], wait_for_all: true}": "parallel_all concurrence",
    "{reactive_switch: {on: EXPRESSION, cases: {VALUE: BEHAVIOUR}, default: BEHAVIOUR}}": "switch2 switch3 switch4 "
    "switch5 switch6",
    "{selector: [BEHAVIOUR, OTHERWISE]}": "try rescue except catch",
    "{selector: [BEHAVIOUR, {sequence: [OTHERWISE, fail]}]}": "try_catch",
    "{selector: [BEHAVIOUR, {sequence: [RECOVERY, BEHAVIOUR]}]}": "recovery recovery_node",
    "{selector: [BEHAVIOUR, BEHAVIOUR], in_turn: true}": "round_robin round_robin_node",
    "{random_selector: [BEHAVIOUR, BEHAVIOUR], weights: [2, 1]}": "probability_selector weighted_selector "
    "weighted_random_selector weighted_choice",
    '{sequence: [{check: "random(0, 1) < 0.5"}, BEHAVIOUR]}': "probability chance random_chance",
    'wait: "${random(1 s, 3 s)}"': "random_wait wait_random random_sleep",
    'set: {LIST: "${LIST + [ITEM]}"}': "append add_to_list push_back list_append",
    "{sequence: [{say: QUESTION}, {listen: {for: [ANSWER, ANSWER]}}]}": "ask ask_for",
}
"""Forms of several words, each with the words of other systems; capitals are placeholders."""

EXPLAINED_SYNONYMS: Mapping[str, str] = {
    "write 'navigate' (a ROS 2 robot with Nav2) or 'go_to' (straight, by odometry)": "navigate_to navigate_to_pose "
    "nav_to move_base",
    "write 'stop', which stops only the base; to end a node early, put 'while', 'until' or 'timeout' beside it": "halt",
    "write 'ros2_action' (a ROS 2 robot), or 'navigate' for Nav2": "action_client ros_action simple_action_client",
    "write 'set: {NAME: VALUE}' as a step; variables need no declaration": "blackboard",
    "write 'wait: TIME' as a step, or 'delay: TIME' beside a behaviour": "delay",
}
"""Hints that need an explanation, each with the words of other systems."""

UNMATCHED_WORDS = (
    "sequence_with_memory sequence_star run_once throttle rate_limit rate_controller debounce distance_controller "
    "speed_controller pipeline_sequence simple_parallel do_while do_until repeat_until until_fail "
    "until_failure manual_selector status_to_blackboard "
    "max_failures single_trigger pick_up_where_you_left_off"
)
"""Words of other systems without an equivalent; the docs page lists the nearest form and the differences."""

UNMATCHED_HINT = "nothing here means the same: see what comes near in docs/language.md#words-of-other-systems"

MIN_LIKENESS = 0.7
"""Minimum similarity (0..1) of an unknown word and a word that moves nothing, to suggest the latter."""

MIN_LONG_LIKENESS = 0.85
"""Minimum similarity (0..1) at which two long words count as one word with up to two typing errors."""

MIN_LONG_WORD = 8
"""Minimum letters of a word in which a changed letter counts as a typing error.

In a shorter word it makes another word: wander, wonder.
"""

SWITCH_HINT = "write switch: {on: CONDITION, cases: {true: ..., false: ...}}"


def unknown_word_hint(
    word: str, leaves: Mapping[str, type[Leaf]], composites: Collection[str], beside: Collection[str], *, alone: bool
) -> str:
    """Return a suggestion for an unknown word: our synonym, or the closest word; empty if there is none.

    ``leaves`` and ``composites`` are the words that can be suggested. ``beside`` are the words that stand beside a
    behaviour; they are not suggested for a word that stands ``alone``.
    """
    known = [*leaves, *composites, *([] if alone else beside)]
    if hint := explained_hint(word):
        return hint
    if to_snake_case(word) in known:
        return f"did you mean '{to_snake_case(word)}'?"
    if to_snake_case(word) in beside:
        return f"'{to_snake_case(word)}' stands beside a behaviour, below it and without a dash"
    if to_snake_case(word) in UNMATCHED_WORDS.split():
        return UNMATCHED_HINT
    ours = [form for form, theirs in PHRASE_SYNONYMS.items() if to_snake_case(word) in theirs.split()]
    if ours:
        return f"write {ours[0]}"
    ours = own_words_for(word, SYNONYMS, [*leaves, *composites, *beside])
    if ours == ["switch"]:
        return SWITCH_HINT
    if ours:
        return f"write {alternatives_text(ours)}" + (", beside a behaviour" if key_of(ours[-1]) in beside else "")
    near = _words_near(word.lower(), [*known, *beside])
    return did_you_mean(word, [each for each in known if _may_propose(word.lower(), each, leaves, known, near)])


def explained_hint(word: str) -> str:
    """Return the hint of ``EXPLAINED_SYNONYMS`` for a word; empty if there is none."""
    hints = (hint for hint, theirs in EXPLAINED_SYNONYMS.items() if to_snake_case(word) in theirs.split())
    return next(hints, "")


def _words_near(word: str, ours: Collection[str]) -> frozenset[str]:
    """Return the words of ``ours`` that are one typing error away from ``word``, themselves or by a synonym."""
    slips = {each for each in ours if is_one_edit(word, each)}
    for each, names in SYNONYMS.items():
        # Shorter words are one letter away from too many others: ``trun`` is ``turn``, not ``run``.
        if any(len(name) > 3 and _is_slip(word, name, max_slips=1) for name in names.split()):
            slips.add(key_of(each))
    return frozenset(slips)


def _may_propose(
    word: str, proposal: str, leaves: Mapping[str, type[Leaf]], known: Collection[str], near: Collection[str]
) -> bool:
    """Return True if ``proposal`` may be suggested for the unknown ``word`` because of its spelling alone.

    It must be a harmless word, or differ by a typing error. A behaviour that moves the robot may be suggested if it is
    the only word in ``near``: ``lay`` can mean ``say`` or ``play``.
    """
    leaf = leaves.get(proposal)
    moves = leaf is not None and bool(leaf.drives.intersection(ACTUATOR_KINDS))
    if moves and not {proposal}.issuperset(near):
        return False
    if leaf is not None and not leaf.instant and not moves:
        alike = SequenceMatcher(None, word, proposal).ratio() >= MIN_LIKENESS
        return alike or proposal.startswith(word) or _is_slip(word, proposal, max_slips=1)
    if leaf is None and len(word) > 2 and [each for each in known if each.startswith(word)] == [proposal]:
        return True
    parts, others = word.split("_"), proposal.split("_")
    same = not moves and len(parts) == len(others) and all(map(_is_slip, parts, others))
    return same or _is_slip(word, proposal, max_slips=1)


def _is_slip(word: str, other: str, *, max_slips: int = 2) -> bool:
    """Return True if ``word`` is ``other`` with a typing error. In short words, a changed letter is another word.

    Long words may have two errors if ``max_slips`` is 2, but not in the first letter: ``unloaded`` is not ``loaded``.
    """
    if max_slips > 1 and word[:1] == other[:1] and min(len(word), len(other)) >= MIN_LONG_WORD:
        return SequenceMatcher(None, word, other).ratio() >= MIN_LONG_LIKENESS
    another_letter = len(word) == len(other) and sorted(word) != sorted(other)
    return word == other or (is_one_edit(word, other) and not (another_letter and len(word) < MIN_LONG_WORD))
