"""From sound to words, with a recogniser that answers when the test says so."""

from collections.abc import Sequence
from random import Random

import numpy as np
import pytest

from perception.api import Hearing
from perception.hearing.listener import CLIP_TIMEOUT, START_TIMEOUT, Ears, RecogniserState, SpeechListener
from perception.hearing.sound import RATE, Piece
from tests.machines import walk
from tests.perception.hearing.workers import LengthEngine, ScriptedWorker, bits, talk
from tests.waiting import wait_until


class Scene:
    def __init__(self, threshold: float = 0.0) -> None:
        self.worker = ScriptedWorker()
        self.changes = 0
        self.speaking = (0.0, 0.0)
        self.listener = SpeechListener(
            self.worker, LengthEngine(), threshold=threshold, is_deaf=self.deaf, changed=self.changed
        )

    def deaf(self, start: float, end: float) -> bool:
        return start < self.speaking[1] and end > self.speaking[0]

    def changed(self) -> None:
        self.changes += 1

    def begin(self) -> None:
        self.listener.on_started()
        self.listener.on_message({"ready": True}, b"")

    def hear(self, *spoken: tuple[float, float], seconds: float, first: int = 0) -> None:
        for piece in bits(talk(*spoken, seconds=seconds), first=first, start=first * 0.02):
            self.listener.process(piece)

    def answer(self, phrase: str, score: float) -> None:
        asked = self.worker.sent[-1][0]["decode"]
        self.listener.on_message({"decoded": asked, "phrase": phrase, "score": score}, b"")


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_new_recogniser_gets_the_phrases(scene: Scene) -> None:
    scene.begin()
    assert scene.worker.sent == [({"phrases": ["yes"]}, b"")]


def test_listening_begins_when_the_recogniser_is_ready(scene: Scene) -> None:
    scene.hear(seconds=1)
    assert scene.listener.listened() is None
    scene.begin()
    scene.hear(seconds=1, first=50)
    assert scene.listener.listened() == pytest.approx(2.0)


def test_spoken_phrase_is_recognised_with_its_times(scene: Scene) -> None:
    scene.begin()
    scene.hear((1.0, 1.5), seconds=3)
    assert scene.listener.is_pending
    assert scene.listener.words() == ()
    scene.answer("yes", 2.5)
    (words,) = scene.listener.words()
    assert (words.id, words.phrase, words.score, words.who) == (1, "yes", 2.5, "")
    assert [words.start, words.stamp] == pytest.approx([1.0, 1.5], abs=0.03)
    assert (scene.listener.refused(), scene.changes, scene.listener.is_pending) == ((), 1, False)


@pytest.mark.parametrize(("threshold", "accepted"), [(0.9, True), (1.0, True), (1.1, False)])
def test_uncertain_phrase_is_refused_with_the_nearest_phrase(threshold: float, accepted: bool) -> None:
    scene = Scene(threshold)
    scene.begin()
    scene.hear((1.0, 1.5), seconds=3)
    scene.answer("yes", 1.0)
    kept, other = scene.listener.words(), scene.listener.refused()
    assert [words.phrase for words in (kept if accepted else other)] == ["yes"]
    assert (other if accepted else kept) == ()


def test_speech_without_a_phrase_is_refused_despite_a_high_score(scene: Scene) -> None:
    scene.begin()
    scene.hear((1.0, 1.5), seconds=3)
    scene.answer("", 9.0)
    assert scene.listener.words() == ()
    assert [words.phrase for words in scene.listener.refused()] == [""]


def test_one_is_recognised_after_the_other(scene: Scene) -> None:
    scene.begin()
    scene.hear((1.0, 1.5), (3.0, 3.5), (5.0, 5.5), seconds=7)
    assert [message.get("decode") for message, _ in scene.worker.sent] == [None, 1]
    scene.answer("yes", 1.0)
    assert [message.get("decode") for message, _ in scene.worker.sent] == [None, 1, 2]
    scene.answer("yes", 2.0)
    scene.answer("yes", 3.0)
    assert [(words.id, round(words.start)) for words in scene.listener.words()] == [(3, 5), (2, 3), (1, 1)]


def test_own_speech_is_not_recognised(scene: Scene) -> None:
    scene.begin()
    scene.speaking = (0.9, 2.0)
    scene.hear((1.0, 1.9), (3.0, 3.5), seconds=5)
    scene.answer("yes", 1.0)
    assert [round(words.start) for words in scene.listener.words()] == [3]
    assert not scene.listener.is_pending
    assert scene.listener.listened() == pytest.approx(5.0)


def test_lost_sound_separates_two_clips(scene: Scene) -> None:
    scene.begin()
    pieces = bits(talk((1.0, 3.0), seconds=5))
    for piece in (*pieces[:75], *pieces[125:]):  # half a second is missing
        scene.listener.process(piece)
    scene.answer("yes", 1.0)
    (words,) = scene.listener.words()
    assert words.start == pytest.approx(2.5, abs=0.03)


def test_dead_recogniser_loses_only_its_pending_clips(scene: Scene) -> None:
    scene.begin()
    scene.hear((1.0, 1.5), (3.0, 3.5), seconds=5)
    scene.listener.on_exit("killed")
    before = scene.listener.listened()
    scene.hear(seconds=1, first=250)
    assert scene.listener.listened() == before
    scene.begin()
    scene.answer("yes", 1.0)
    assert [round(words.start) for words in scene.listener.words()] == [3]
    assert not scene.listener.is_pending


def test_unreachable_recogniser_is_harmless(scene: Scene) -> None:
    scene.begin()
    scene.worker.broken = True
    scene.hear((1.0, 1.5), seconds=3)
    scene.listener.on_exit("gone")
    scene.listener.on_started()
    assert scene.listener.words() == ()
    assert not scene.listener.is_ready


def test_hanging_recogniser_is_killed_and_listening_pauses(scene: Scene) -> None:
    scene.begin()
    scene.hear((1.0, 1.5), seconds=CLIP_TIMEOUT + 1)
    assert scene.worker.kills == 0
    scene.hear(seconds=2, first=round(50 * (CLIP_TIMEOUT + 1)))
    assert scene.worker.kills > 0
    assert scene.listener.listened() == pytest.approx(CLIP_TIMEOUT + 2, abs=0.1)


def test_recogniser_hanging_at_its_start_is_killed(scene: Scene) -> None:
    scene.hear(seconds=0.1, first=50 * 100)
    scene.listener.on_started()
    scene.hear(seconds=0.1, first=50 * 200)  # its time counts from the first sound on
    scene.hear(seconds=0.1, first=round(50 * (199 + START_TIMEOUT)))
    assert scene.worker.kills == 0
    scene.hear(seconds=0.1, first=round(50 * (201 + START_TIMEOUT)))
    assert scene.worker.kills > 0


def test_restarted_recogniser_gets_its_full_start_time(scene: Scene) -> None:
    scene.listener.on_started()
    scene.hear(seconds=0.1)
    scene.listener.on_exit("killed")
    scene.hear(seconds=0.1, first=round(50 * (START_TIMEOUT + 1)))
    scene.begin()
    scene.hear(seconds=0.1, first=round(50 * 2 * (START_TIMEOUT + 1)))
    assert scene.worker.kills == 0


def test_new_recogniser_has_no_pending_clips(scene: Scene) -> None:
    scene.begin()
    scene.hear((1.0, 1.5), seconds=3)
    scene.listener.on_started()  # closed and opened: nobody tells that the last was lost
    assert not scene.listener.is_ready
    assert not scene.listener.is_pending


def test_unrequested_answer_is_dropped(scene: Scene) -> None:
    scene.begin()
    scene.listener.on_message({"decoded": 7, "phrase": "yes", "score": 9.0}, b"")
    assert (scene.listener.words(), scene.changes) == ((), 0)


def test_words_are_forgotten_after_half_a_minute(scene: Scene) -> None:
    scene.begin()
    for start in (1.0, 20.0, 40.0):
        scene.hear((1.0, 1.5), seconds=3, first=round((start - 1) * 50))
        scene.answer("yes", 1.0)
    assert [round(words.start) for words in scene.listener.words()] == [40, 20]


def test_level_is_that_of_the_last_moment(scene: Scene) -> None:
    assert scene.listener.level() == -90
    full = np.where(np.arange(3200) % 2, 32767, -32767).astype(np.int16)
    for piece in bits(full):
        scene.listener.process(piece)
    assert scene.listener.level() == pytest.approx(0, abs=0.01)
    for piece in bits(np.zeros(1600, np.int16), first=10):
        scene.listener.process(piece)
    assert scene.listener.level() == -90


@pytest.mark.real_time
def test_reopened_ears_accept_restarted_numbers(scene: Scene) -> None:
    microphone = Microphone(bits(talk((1.0, 1.5), seconds=3)))
    ears = Ears(microphone, scene.listener, scene.worker)
    try:
        for _ in range(2):
            ears.open()
            scene.begin()
            microphone.failures = 0
            wait_until(lambda: microphone.failures >= 2)
            scene.answer("yes", 1.0)
            ears.close()
    finally:
        ears.close()
    assert len(scene.listener.words()) == 2


class Microphone:
    """Gives all its sound at once, and then fails."""

    def __init__(self, pieces: list[Piece]) -> None:
        self.pieces = pieces
        self.failures = 0

    def read(self, after: int) -> Sequence[Piece]:
        left = [piece for piece in self.pieces if piece.number > after]
        if not left:
            self.failures += 1
            raise OSError("no more sound")
        return left


@pytest.mark.real_time
def test_ears_listen_on_a_thread_of_their_own_and_survive_trouble(scene: Scene) -> None:
    microphone = Microphone(bits(talk((1.0, 1.5), seconds=3)))
    troubles: list[Exception] = []
    ears = Ears(microphone, scene.listener, scene.worker, on_trouble=troubles.append)
    hearing: Hearing = scene.listener
    ears.close()
    scene.begin()
    ears.open()
    ears.open()
    try:
        wait_until(lambda: len(scene.worker.sent) == 2 and microphone.failures >= 2)
        scene.answer("yes", 1.0)
        assert [words.phrase for words in hearing.words()] == ["yes"]
        assert hearing.refused() == ()
        assert hearing.listened() == pytest.approx(3.0)
        assert -60 < hearing.level() < -50
        assert [str(trouble) for trouble in troubles] == ["no more sound"]
        assert len(scene.worker.sent[1][1]) > RATE
    finally:
        ears.close()
        ears.close()
    assert scene.worker.talker is None


def test_random_events_of_a_recogniser_take_every_transition_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def live(scene: Scene, _: Random) -> None:
        scene.listener.on_started()

    def get_ready(scene: Scene, _: Random) -> None:
        if scene.listener._state is not RecogniserState.ABSENT:
            scene.listener.on_message({"ready": True}, b"")

    def talk_to_it(scene: Scene, _: Random) -> None:
        scene.hear((0.1, 0.4), seconds=1.0)

    def answer(scene: Scene, _: Random) -> None:
        if scene.listener.is_ready and scene.listener.is_pending and "decode" in scene.worker.sent[-1][0]:
            scene.answer("yes", 1.0)

    def lose(scene: Scene, _: Random) -> None:
        scene.listener.on_exit("killed")

    actions = [live, lose, *[get_ready, answer, answer] * 2, talk_to_it]
    table = walk(monkeypatch, "perception.hearing.listener.TRANSITIONS", Scene, actions, walks=12)
    assert table.visited == set(table)
    assert not table.missing
