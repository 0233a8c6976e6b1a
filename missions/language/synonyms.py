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
    "wait": "sleep pause sleep_for delay_for idle timer wait_seconds wait_state wait_for_duration elapsed "
    "wait_blackboard_time nav_delay condition_delay loiter_time nav_loiter_time",
    "drive: 1 m": "forward forwards move move_forward go_forward drive_forward drive_straight drive_distance "
    "drive_on_heading move_steps",
    "drive: -1 m": "back backward backwards move_back move_backward go_backward drive_backward back_up reverse",
    "turn: 90 deg": "rotate rotate_in_place spin turn_left rotate_left spin_round turn_degrees "
    "turn_anticlockwise turn_counterclockwise",
    "turn: 180 deg": "turn_around turn_back",
    "turn: -90 deg": "turn_right rotate_right turn_clockwise",
    "go_to": "goto move_to drive_to goto_pose go_to_pose nav_waypoint",
    "velocity": "cmd_vel twist set_velocity set_speed",
    "stop": "brake freeze stop_base stop_robot stop_moving",
    "look": "move_head turn_head set_head point_head look_forward",
    "look: 30 deg": "look_left head_left",
    "look: -30 deg": "look_right head_right",
    "nod": "nod_head",
    "move_joints": "move_joint set_joint set_joints move_servo set_servo do_set_servo move_arm",
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
    "log": "print echo debug info printf puts log_state log_message log_key_state console_print",
    "set: {NAME: VALUE}": "let assign set_blackboard set_variable set_blackboard_variable set_var "
    "set_fact var variable script",
    "find_face": "look_for_face search_face",
    "succeed": "pass noop nop always_success success do_nothing",
    "set: {NAME: []}": "reset_vector clear_list delete_all_of_list",
    "set: {NAME: null}": "unset_blackboard unset_blackboard_variable unset",
    "fail": "always_failure failure raise error",
    "pretend": "mock stub status_queue",
    "sequence": "and seq do steps block tasks series serial begin all_of async_sequence mem_sequence memory_sequence "
    "serial_star",
    "selector": "or fallback priority any any_of either alternatives sel first_of async_fallback fallback_star "
    "mem_priority mem_selector selector_star",
    "reactive_sequence": "reactive_and dynamic_sequence",
    "reactive_selector": "reactive_or reactive_fallback reactive_priority priority dynamic_selector selector_evaluator",
    "parallel": "simultaneously together concurrent concurrently at_once parallel_ff parallel_first_fail",
    "race": "parallel_complete",
    "switch": "then else elif else_if otherwise case match select cond if_else if_then_else decision_state",
    "reactive_switch": "while_do_else",
    "mission": "call run subtree sub_tree sub_tree_plus submission include import uses execute start_mission name "
    "run_behavior run_behavior_dynamic behavior_tree_reference execute_behavior include_tasks import_tasks "
    "include_role link_call",
    "repeat": "loop times again cycle num_cycles num_success repeater",
    "repeat: forever": "forever repeat_forever keep_running_until_failure loop_forever success_is_running",
    "retry": "attempts retry_until_successful retry_until_succesful retry_node tries max_attempts num_attempts "
    "num_failures",
    "recover": "recover_with on_retry before_retry between_attempts recovery_action recovery_behavior",
    "finally": "on_exit exit_action on_end at_end at_exit cleanup clean_up teardown tear_down finalize finalise ensure "
    "defer run_always always _post _on_halted",
    "retry: forever": "retry_forever retry_until_success repeat_until_success failure_is_running",
    "if": "when only_if",
    "if: not (...)": "unless if_not not_if skip_if _skip_if",
    "while": "as_long_as during eternal_guard guard",
    "while: not (...)": "while_not",
    "until: not (...)": "until_not",
    "timeout": "time_limit timeout_after max_time deadline timeout_seconds",
    "invert: true": "not inverter negate invert_result",
    "on_failure: succeed": "ignore_errors ignore_failure force_success continue_on_error failure_is_success "
    "no_fail return_success always_succeed ignore_unreachable",
    "on_success: fail": "force_failure success_is_failure return_failure always_fail",
    "once: true": "only_once one_shot oneshot",
    "on_running: fail": "running_is_failure",
    "on_running: succeed": "running_is_success",
    "delay": "after start_after",
    "success_count": "success_threshold",
    "failure_count": "failure_threshold",
    "as": "register store save result output into keep_as response_variable",
    "with": "params args arguments inputs parameters",
    "name": "title label alias",
    "summary": "description desc about help",
    "params": "parameters args arguments inputs vars variables env fields input_keys",
    "tree": "root steps tasks behavior_tree behaviour_tree behavior behaviour nodes do main actions",
    "returns": "outputs output return results output_keys",
    "properties": "promises asserts",
}
"""Our words, each with the words of other systems that mean the same.

A word of ours has an argument if the meaning needs it, such as ``turn: -90 deg`` for ``turn_right``. A synonym is not
used if it is the tag of an existing leaf. Behaviours that move are suggested only for words that mean motion.
"""

PHRASE_SYNONYMS: Mapping[str, str] = {
    "{check: CONDITION}": "condition check_condition script_condition check_blackboard_variable_value "
    "check_blackboard_variable_exists check_blackboard assert require verify "
    "conditions check_var check_condition_state check_agent_property compare_blackboard_variables",
    "{sequence: [{check: CONDITION}, BEHAVIOUR]}": "precondition blackboard_condition blackboard_based_condition "
    "compare_bbentries conditional_evaluator",
    "{check: not (CONDITION)}": "error_if throw_if",
    "{check: battery.low}": "is_battery_low battery_low",
    "{sequence: [{check: not (CONDITION)}, BEHAVIOUR]}": "_failure_if",
    "{selector: [{check: CONDITION}, BEHAVIOUR]}": "_success_if",
    "{sequence: [BEHAVIOUR, {set: {NAME: VALUE}}]}": "_on_success",
    "{selector: [BEHAVIOUR, {sequence: [{set: {NAME: VALUE}}, fail]}]}": "_on_failure",
    "{sequence: [BEHAVIOUR, {check: CONDITION}], repeat: forever, on_failure: succeed}": "do_while",
    "{sequence: [BEHAVIOUR, {check: not (CONDITION)}], repeat: forever, on_failure: succeed}": "do_until",
    "{sequence: [{selector: [BEHAVIOUR, succeed]}, {check: CONDITION}], repeat: forever, on_failure: succeed}": ""
    "conditional_loop",
    "{wait_until: CONDITION}": "wait_for_condition wait_for_blackboard_variable wait_for_blackboard_variable_value "
    "wait_template condition_state",
    "{wait_for: BEHAVIOUR}": "wait_for_success until_success",
    "{BEHAVIOUR: , for: 10 s}": "run_for for_duration",
    "{for_each: {in: LIST, as: NAME, do: BEHAVIOUR}}": "foreach each for_all map loop_over iterate iterator for_in "
    "with_items with_dict loop_var loop_control loop_int loop_bool",
    "{wait_until: false}": "runner running always_running wait_forever nav_loiter_unlim",
    "{sequence: [{wait_until: not (CONDITION)}, {wait_until: CONDITION}]}": "wait_for_trigger",
    "{sequence: [BEHAVIOUR, {check: not (CONDITION)}]}": "failed_when",
    "{parallel: [BEHAVIOUR, BEHAVIOUR], success_count: 1, failure_count: all}": "parallel_selector "
    "parallel_first_success",
    "{race: [BEHAVIOUR, {sequence: [BACKGROUND], on_failure: succeed, repeat: forever}]}": "simple_parallel",
    "{reactive_switch: {on: UTILITY >= UTILITY, cases: {true: {selector: [BEHAVIOUR, OTHER]}, false: {selector: "
    "[OTHER, BEHAVIOUR]}}}}": "utility_selector",
    "{parallel: [BEHAVIOUR, BEHAVIOUR], wait_for_all: true}": "parallel_all concurrence",
    "{reactive_switch: {on: EXPRESSION, cases: {VALUE: BEHAVIOUR}, default: BEHAVIOUR}}": "switch2 switch3 switch4 "
    "switch5 switch6",
    "{selector: [BEHAVIOUR, OTHERWISE]}": "try rescue except catch",
    "{selector: [BEHAVIOUR, {sequence: [OTHERWISE, fail]}]}": "try_catch",
    "{selector: [BEHAVIOUR, {sequence: [RECOVERY, BEHAVIOUR]}]}": "recovery recovery_node",
    "{selector: [BEHAVIOUR, BEHAVIOUR], in_turn: true}": "round_robin round_robin_node round_robin_star",
    "{random_selector: [BEHAVIOUR, BEHAVIOUR], weights: [2, 1]}": "probability_selector weighted_selector "
    "weighted_random_selector weighted_choice",
    '{sequence: [{check: "random(0, 1) < 0.5"}, BEHAVIOUR]}': "probability chance random_chance "
    "probabilistic_behaviour",
    'wait: "${random(1 s, 3 s)}"': "random_wait wait_random random_sleep",
    'set: {LIST: "${LIST + [ITEM]}"}': "append add_to_list add_to_vector push_back list_append",
    'set: {NAME: "${EXPRESSION}"}': "calculation_state calculate compute evaluate_expression",
    'set: {NAME: "${NAME + 1}"}': "increment change_by change_variable_by",
    'set: {NAME: "${NAME - 1}"}': "decrement",
    'set: {NAME: "${LIST[0]}"}': "get_element_of_vector",
    'set: {NAME: "${len(LIST)}"}': "get_size_of_vector",
    "{sequence: [{wait_until: NAME}, {set: {NAME: false}}, BEHAVIOUR], repeat: forever}": "when_i_receive",
    "{sequence: [{say: QUESTION}, {listen: {for: [ANSWER, ANSWER]}}]}": "ask ask_for ask_and_wait get_text_from_user",
}
"""Forms of several words, each with the words of other systems; capitals are placeholders."""

SWITCH_HINT = "write switch: {on: CONDITION, cases: {true: ..., false: ...}}"

EXPLAINED_SYNONYMS: Mapping[str, str] = {
    "write 'navigate' (a ROS 2 robot with Nav2) or 'go_to' (straight, by odometry)": "navigate_to navigate_to_pose "
    "nav_to move_base",
    "write 'stop', which stops only the base; to end a node early, put 'while', 'until' or 'timeout' beside it": "halt",
    "write 'ros2_action' (a ROS 2 robot), or 'navigate' for Nav2": "action_client ros_action simple_action_client "
    "simple_action_state",
    "write 'set: {NAME: VALUE}' as a step; variables need no declaration": "blackboard userdata",
    "write 'wait: TIME' as a step, or 'delay: TIME' beside a behaviour": "delay",
    "write 'timeout: N min' beside a behaviour": "timeout_minutes",
    f"{SWITCH_HINT}; further conditions go into a switch after 'false:', and 'succeed' does nothing there": "choose",
    "write 'race', which ends with the first child that ends, or 'random_selector', which runs one of them": "one_of",
    "write 'race', which ends with the first child that ends; or {parallel: [BEHAVIOUR, BEHAVIOUR], success_count: 1, "
    "failure_count: all}, which ends with the first success": "parallel_fs",
    "write 'set: {NAME: true}', and 'set: {NAME: false}' at the start; 'wait_until: NAME' waits for it, "
    "'check: NAME' tests it": "emit send_event fire_event broadcast has_received_event",
    "write {sequence: [{check: not (CONDITION)}, BEHAVIOUR], repeat: forever, on_failure: succeed}; for a loop that "
    "runs once at least, put the check behind the behaviour": "repeat_until",
    "write 'repeat: forever' beside a behaviour; it ends with the failure, and 'on_failure: succeed' below it makes "
    "that a success": "repeat_until_failure until_failure until_fail",
    "write 'selector', with the most important child first": "priority_selector",
    "write 'retry: N' beside a behaviour, where N is the number of retries plus 1": "retries",
    "write 'succeed' as a step; around a behaviour, 'on_failure: succeed' beside it": "succeeder",
    "write 'fail' as a step; around a behaviour, 'on_success: fail' beside it": "failer",
    "write 'if: CONDITION' and 'until: not (CONDITION)' beside a behaviour": "_while",
    "write 'mission': each mission has its own variables": "new_scope",
    "write 'with' beside 'mission' for its params, and 'returns' for its results": "remapping",
    "write 'repeat: N' beside a sequence of the repeated steps, where N is the number of jumps plus 1": "do_jump",
    "write 'call_service' (a ROS 2 robot)": "service_state",
    "write 'succeed' or 'fail'": "finish_with_result",
    "write 'while: CONDITION' beside a behaviour to end it (Self), 'reactive_selector' to let an earlier child take "
    "over (Lower Priority)": "observer_aborts conditional_abort conditional_aborts",
    "write 'if: false' beside a behaviour that must not run": "enabled",
    "write 'for: TIME' in place of 'timeout: TIME'": "continue_on_timeout",
    "leave it out: it does nothing": "pass_through",
    "write a comment after '#'": "comment",
    "write 'sequence', which goes on after a success, or 'selector', which goes on after a failure": "transitions "
    "state_machine outcome_map outcomes",
    "write {sequence: [BEHAVIOUR, BEHAVIOUR]}: a behaviour starts after the success of the one before it": "needs",
    "write 'wait_for_all: true' beside 'parallel' for false; true is the default": "fail_fast",
    "write {for_each: {in: LIST, as: NAME, do: BEHAVIOUR}}, which takes the members one after another": "matrix "
    "strategy",
    "start the mission with 'mission run' or as a task (docs/tasks.md); within it, write {wait_until: CONDITION}": ""
    "trigger triggers when_flag_clicked inject",
    "write a leaf in Python: see docs/leaves.md": "cbstate call_method run_process",
    "write 'call_service' (a ROS 2 robot); or, to run a behaviour regularly beside another, {race: [BEHAVIOUR, "
    "{sequence: [SERVICE, {wait: 500 ms}], on_failure: succeed, repeat: forever}]}": "service",
    "write 'set: {runs: 0}' at the start, and here {sequence: [{check: runs < N}, BEHAVIOUR, {set: {runs: \"${runs + "
    '1}"}}]}': "run_limit",
    "write 'set: {runs: 0}' at the start, and here {sequence: [{check: runs < N}, {set: {runs: \"${runs + 1}\"}}, "
    "BEHAVIOUR]}": "limiter",
    "write 'set: {done: false}' before the composite around it, and here {selector: [{sequence: [{check: not done}, "
    "BEHAVIOUR, {set: {done: true}}]}, {sequence: [{set: {done: true}}, fail]}]}": "single_trigger",
}
"""Hints that need an explanation, each with the words of other systems."""

FUNCTION_SYNONYMS: Mapping[str, str] = {
    "put the step under 'finally:' beside the steps before it": "always",
    "write {selector: [BEHAVIOUR, {sequence: [OTHERWISE, fail]}]}, with the steps before it as BEHAVIOUR": "failure",
    "leave it out: a sequence goes on after a success only": "success",
    "write round(random(1, 7) // 1) for a whole number from 1 to 6": "pick_random randint random_int",
    "write random(LOW, HIGH)": "rand uniform random_float",
    "write 'ITEM in LIST'": "contains includes",
    "write len(LIST)": "length size count",
    "write 'VALUE // 1'": "floor",
    "write 'wait: TIME' as a step": "elapsed",
}
"""Hints for functions of other systems, each with their names."""

UNMATCHED_WORDS = (
    "sequence_with_memory sequence_star run_once throttle rate_limit rate_controller debounce distance_controller "
    "speed_controller pipeline_sequence manual_selector status_to_blackboard max_failures pick_up_where_you_left_off"
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


def function_hint(word: str) -> str:
    """Return what to write for a function of another system; empty if it is unknown."""
    return next((hint for hint, theirs in FUNCTION_SYNONYMS.items() if to_snake_case(word) in theirs.split()), "")


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
