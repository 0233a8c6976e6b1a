"""``mission hear``: try speech recognition with a microphone or a recording."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from math import ceil
from pathlib import Path
from threading import Event

import click

from config.library import find_file
from config.robot import Section
from drivers.api import SOUND_RATE, DeviceStatus
from drivers.api.driver import DriverContext
from drivers.api.kinds import KINDS
from drivers.api.sensor_sections import MAX_THRESHOLD, MicrophoneKeys
from drivers.clock import ManualClock, SystemClock
from drivers.errors import NoReply, NotConnected
from drivers.microphone.wav_microphone import WavMicrophone, load_wav
from missions.assembly.assembled_robot import CONNECT_TIMEOUT
from missions.assembly.hearing import MicrophoneEars, make_ears
from missions.assembly.part_factory import resolve_maker
from missions.cli.names import MISSION, ROBOT
from missions.cli.numbers import RealNumber
from missions.cli.option_declarations import behaviours_option, params_option
from missions.cli.options import leaf_loader
from missions.cli.printable import overwrite_line
from missions.cli.root import SUCCESS
from missions.language.phrases import all_phrases
from missions.library.drivers import DriverTable, load_robot
from missions.library.pronunciation import find_confusable_phrases
from missions.library.shipped import load_mission
from perception.api import Words
from perception.hearing.engines import MODEL_ENGINES, SphinxEngine
from perception.hearing.grammar import PhraseGrammar, phrase_error

POLL_INTERVAL = 0.05
"""Seconds between two checks for recognised phrases."""

MIN_LEVEL, BAR_WIDTH = -70.0, 40
"""Width of the level bar at 0 dBFS; it is empty at ``MIN_LEVEL`` dBFS."""

STEP_TIME, TRAILING_SILENCE = 2.0, 2.0
"""Seconds of silence after a recording, which end its last words; ``STEP_TIME`` is the step through it."""

RECOGNITION_TIMEOUT = 20.0
"""Maximum seconds to wait for the speech recogniser to start, and for it to recognise a phrase."""


def _check_threshold(ctx: click.Context, option: click.Parameter, value: float | None) -> float | None:
    """Raise click.BadParameter for a threshold that no robot file may have, including NaN."""
    if value is not None and not -MAX_THRESHOLD <= value <= MAX_THRESHOLD:
        raise click.BadParameter(f"must be between {-MAX_THRESHOLD:g} and {MAX_THRESHOLD:g}", ctx=ctx, param=option)
    return value


@click.command(epilog="Example: mission hear --for 'yes, no, stop'")
@click.argument("mission", type=MISSION, required=False)
@click.option("--for", "phrases", metavar='"yes, no"', help="Phrases to listen for, instead of a mission's.")
@click.option(
    "--robot", type=ROBOT, help="Robot with microphone and pronunciations; by default the system's microphone."
)
@click.option(
    "--wav", type=click.Path(path_type=Path, dir_okay=False), help="Recording to use instead of a microphone."
)
@click.option(
    "--threshold",
    type=RealNumber(),
    callback=_check_threshold,
    help="Minimum score, instead of the one in the robot file.",
)
@params_option
@behaviours_option
def command(
    mission: str | None,
    phrases: str | None,
    robot: str | None,
    wav: Path | None,
    threshold: float | None,
    params: dict[str, str],
    files: tuple[Path, ...],
) -> int:
    """Print each recognised phrase with its score, and whether it is accepted.

    Listens for the phrases of MISSION, or for those in --for. A refused utterance is shown with the nearest phrase. A
    score of 0 means that the phrase is as likely as not. Ctrl-C ends it.
    """
    phrases_to_hear = _find_phrases(mission, phrases, params, files)
    section = _microphone_section(robot)
    config: MicrophoneKeys = section.keys
    if threshold is not None:
        config = replace(config, threshold=threshold)
    click.echo(f"listening for: {', '.join(phrases_to_hear)}")
    for one, other in find_confusable_phrases(config, PhraseGrammar.from_texts(phrases_to_hear).phrases):
        click.echo(f"mission: '{one}' and '{other}' are easily confused\n  try: another or a longer phrase", err=True)
    if wav is None:
        _listen(replace(section, keys=config), phrases_to_hear)
    else:
        _play(config, phrases_to_hear, wav)
    return SUCCESS


def _find_phrases(
    mission: str | None, phrases: str | None, params: Mapping[str, str], files: Sequence[Path]
) -> Sequence[str]:
    """Return the phrases to listen for: those of the mission, or those given, separated by commas.

    All params of the mission must be set, since they may be part of its phrases.
    """
    if (mission is None) == (phrases is None):
        raise click.UsageError('no phrases given: name a mission, or add --for "yes, no"')
    if mission is not None:
        found = all_phrases(
            load_mission(mission, params=params, complete=True, leaves=leaf_loader(files)(mission)).tree
        )
        if not found:
            raise click.UsageError(f"mission '{mission}' does not listen for anything")
        return found
    if params or files:
        raise click.UsageError("--param and --behaviours need a mission, not --for")
    texts = [text.strip() for text in (phrases or "").split(",")]
    for text in texts:
        if fault := phrase_error(text):
            raise click.BadParameter(f"'{text}': {fault}", param_hint="--for")
    return texts


def _microphone_section(robot: str | None) -> Section:
    """Return the microphone section of a robot file, or a default one without ``robot``.

    Raises click.UsageError for a robot without a microphone.
    """
    if robot is None:
        kind = KINDS["microphone"]
        return Section(DriverTable().find(kind.name, kind.default_driver), MicrophoneKeys())
    section = load_robot(find_file("robots", robot)).sections.get("microphone")
    if section is None:
        raise click.UsageError(f"robot '{robot}' has no microphone: add `microphone: {{}}` to its file")
    return section


def _listen(section: Section, phrases: Sequence[str]) -> None:
    """Show the microphone level and the recognised phrases until Ctrl-C."""
    clock, pause = SystemClock(), Event()
    config: MicrophoneKeys = section.keys
    source = resolve_maker(section.driver.make, section, "make")(config, DriverContext(clock))
    ears = make_ears(config, source, phrases, clock, report=_print_fault)
    with closing(ears):
        ears.open()
        while not (health := ears.health()).online:
            if clock.now() > CONNECT_TIMEOUT:
                raise NotConnected(health.detail, hint=health.hint)
            pause.wait(POLL_INTERVAL)
        shown = 0
        while True:
            for words in _new_words(ears, shown):
                shown = words.id
                overwrite_line("")
                click.echo(_result_line(words, config.threshold))
            overwrite_line(_level_bar(ears.level()))
            pause.wait(POLL_INTERVAL)


def _play(config: MicrophoneKeys, phrases: Sequence[str], wav: Path) -> None:
    """Print the phrases in a recording, as fast as they are recognised."""
    clock = ManualClock()
    seconds = len(load_wav("microphone", wav)) / SOUND_RATE + TRAILING_SILENCE
    source = WavMicrophone(wav, clock)
    ears = make_ears(config, source, phrases, clock, report=_print_fault)
    hint = MODEL_ENGINES.get(config.recogniser, SphinxEngine).hint
    with closing(ears):
        ears.open()
        _wait_until(lambda: ears.listener.is_ready, ears, hint)
        shown = 0
        for _ in range(ceil(seconds / STEP_TIME)):
            clock.advance(STEP_TIME)
            _wait_until(
                lambda: (ears.listened() or 0.0) > clock.now() - STEP_TIME and not ears.listener.is_pending,
                ears,
                hint,
            )
            for words in _new_words(ears, shown):
                shown = words.id
                click.echo(_result_line(words, config.threshold))


def _wait_until(condition: Callable[[], bool], ears: MicrophoneEars, hint: str) -> None:
    """Wait in real time until ``condition`` returns True. Raises NoReply after ``RECOGNITION_TIMEOUT``.

    The error tells the fault that the microphone ``ears`` reports, and the suggestion ``hint``.
    """
    clock, pause = SystemClock(), Event()
    while not condition():
        if clock.now() > RECOGNITION_TIMEOUT:
            silent = f"microphone: no reply from the recogniser for {RECOGNITION_TIMEOUT:g} s"
            raise NoReply(ears.health().detail or silent, hint=hint)
        pause.wait(POLL_INTERVAL / 10)


def _new_words(ears: MicrophoneEars, shown: int) -> Iterator[Words]:
    """Return the utterances after the first ``shown`` ones, recognised or refused, in order."""
    recent = sorted((*ears.words(), *ears.refused()), key=lambda words: words.id)
    return (words for words in recent if words.id > shown)


def _result_line(words: Words, threshold: float) -> str:
    """Return the output line for an utterance: time, verdict, phrase and score."""
    if not words.phrase:
        return f"{words.start:7.1f} s  refused   no similar phrase"
    verdict = "accepted" if words.score >= threshold else "refused "
    return f"{words.start:7.1f} s  {verdict}  {words.phrase}  (score {words.score:+.1f})"


def _level_bar(level: float) -> str:
    """Return a microphone level (dBFS) as a number and a bar of ``#`` signs."""
    signs = round(BAR_WIDTH * min(max(1 - level / MIN_LEVEL, 0.0), 1.0))
    return f"{level:6.1f} dB  {'#' * signs}"


def _print_fault(notice: DeviceStatus) -> None:
    if notice.kind == "fault":
        click.echo(f"mission: {notice.message}" + (f"\n  try: {notice.hint}" if notice.hint else ""), err=True)
