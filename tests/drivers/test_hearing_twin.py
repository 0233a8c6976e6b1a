"""What simulated people say, as the twin of the ears understands it."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DeviceStatus
from drivers.microphone.twin import HearingTwin
from drivers.sim.person_actions import PersonReply
from drivers.sim.timeline import Timeline
from perception.api import Hearing, Words
from perception.hearing.grammar import PhraseGrammar

PHRASES = PhraseGrammar.from_texts(["yes", "no", "thank you"])


class Scene:
    def __init__(self, mishearing: float = 0.0, seed: int = 0) -> None:
        self.timeline = Timeline()
        self.notices: list[DeviceStatus] = []
        self.changes = 0
        self.speaking: list[tuple[float, float]] = []
        self.twin = HearingTwin(
            self.timeline.clock,
            PHRASES,
            Words,
            is_deaf=lambda start, end: any(start < until and end > since for since, until in self.speaking),
            mishearing=mishearing,
            seed=seed,
            report=self.notices.append,
            changed=self.changed,
        )
        self.hearing: Hearing = self.twin
        self.twin.open()
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def changed(self) -> None:
        self.changes += 1

    def say(self, text: str, when: float = 1.0, who: str = "ann") -> None:
        self.timeline.call_at(when, lambda: self.twin.on_reply(PersonReply(who, text, when)))

    def phrases(self) -> list[str]:
        return [words.phrase for words in self.hearing.words()]


@pytest.fixture
def scene() -> Iterator[Scene]:
    scene = Scene()
    yield scene
    scene.twin.close()


def test_phrase_is_recognised_once_spoken(scene: Scene) -> None:
    scene.say("Thank you!")
    scene.timeline.run_until(1.7)
    assert scene.hearing.words() == ()
    assert scene.hearing.level() > -30
    scene.timeline.run_until(1.9)
    (words,) = scene.hearing.words()
    assert (words.id, words.phrase, words.who) == (1, "thank you", "ann")
    assert words.score > 0
    assert [words.start, words.stamp] == pytest.approx([1.0, 1.8], abs=0.06)
    assert (scene.changes, scene.hearing.refused(), scene.hearing.level()) == (1, (), -90)


def test_other_words_beside_a_phrase_are_passed_over_and_other_speech_refused(scene: Scene) -> None:
    scene.say("well, yes please", 1.0)
    scene.say("I would like a coffee", 4.0)
    scene.timeline.run_until(8.0)
    assert scene.phrases() == ["yes"]
    (refused,) = scene.hearing.refused()
    assert (refused.phrase, refused.score < 0) == ("", True)
    assert scene.twin.health().counters == {"connections": 1, "heard": 2, "understood": 1, "lost": 0}


@given(st.text(max_size=40))
def test_speech_without_a_phrase_gives_no_words(text: str) -> None:
    scene = Scene()
    scene.say(text)
    scene.timeline.run_until(60.0)
    assert scene.phrases() == [phrase for phrase in [PHRASES.find(text)] if phrase and 1 + 0.4 * len(text.split()) > 30]


def test_people_let_the_robot_finish(scene: Scene) -> None:
    scene.speaking = [(0.5, 3.0)]
    scene.say("yes")
    scene.timeline.run_until(2.9)
    assert scene.hearing.level() == -90
    scene.timeline.run_until(4.0)
    (words,) = scene.hearing.words()
    assert words.start == pytest.approx(3.0, abs=0.11)


def test_phrase_during_own_speech_is_lost(scene: Scene) -> None:
    scene.speaking = [(1.2, 1.3)]
    scene.say("thank you")
    scene.timeline.run_until(5.0)
    assert (scene.phrases(), scene.hearing.refused()) == ([], ())
    assert scene.twin.health().counters["lost"] == 1


def test_phrases_are_kept_for_half_a_minute(scene: Scene) -> None:
    scene.say("yes", 1.0)
    scene.say("no", 20.0)
    scene.timeline.run_until(30.0)
    assert scene.phrases() == ["no", "yes"]
    scene.timeline.run_until(45.0)
    assert scene.phrases() == ["no"]


def test_unplugged_hearing_is_offline_and_stops_listening(scene: Scene) -> None:
    scene.timeline.run_until(2.0)
    assert scene.hearing.listened() == pytest.approx(2.0, abs=0.06)
    scene.twin.plug.unplug()
    scene.say("yes", 3.0)
    scene.timeline.run_until(5.0)
    assert scene.hearing.listened() == pytest.approx(2.0, abs=0.06)
    assert not scene.twin.health().online
    scene.twin.plug.plug_in()
    scene.say("no", 6.0)
    scene.timeline.run_until(8.0)
    assert scene.phrases() == ["no"]
    assert [notice.kind for notice in scene.notices] == ["online", "offline", "online"]


def test_phrase_interrupted_by_an_unplug_is_lost(scene: Scene) -> None:
    scene.say("thank you", 1.0)
    scene.timeline.run_until(1.3)
    scene.twin.plug.unplug()
    scene.twin.plug.plug_in()
    scene.timeline.run_until(5.0)
    assert scene.phrases() == []


def test_deaf_hearing_stays_online_without_phrases(scene: Scene) -> None:
    scene.twin.hears_nothing = True
    scene.say("yes")
    scene.timeline.run_until(3.0)
    assert (scene.phrases(), scene.twin.health().online) == ([], True)
    assert scene.hearing.listened() == pytest.approx(3.0, abs=0.06)


def test_mishearing_rate_is_as_configured_and_reproducible() -> None:
    def outcome() -> tuple[int, int]:
        scene = Scene(mishearing=0.3, seed=5)
        right = wrong = 0
        for number in range(200):
            scene.say("yes", number * 2.0 + 1.0)
            scene.timeline.run_until(number * 2.0 + 2.9)
            newest = [words.phrase for words in scene.hearing.words() if words.start > number * 2.0]
            right += newest == ["yes"]
            wrong += newest in (["no"], ["thank you"])
        return right, wrong

    right, wrong = outcome()
    assert 120 <= right <= 160
    assert 20 <= wrong <= 60
    assert outcome() == (right, wrong)


def test_hearing_is_offline_before_open_and_after_close() -> None:
    twin = HearingTwin(Timeline().clock, PHRASES, Words)
    twin.close()
    twin.rest()
    twin.on_reply(PersonReply("ann", "yes", 0.0))
    twin.step()
    assert (twin.words(), twin.listened(), twin.health().online) == ((), None, False)
