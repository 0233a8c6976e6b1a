"""Phrases to listen for: as text, as words that are pronounced, and as a network."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.hearing.grammar import END, START, PhraseGrammar, normalise, phrase_error
from perception.hearing.lexicon import KIND_OF, VOWELS, Lexicon, british_variants, espeak_to_phones, find_confusable

DICTIONARY = """stop S T AA P
start S T AA R T
forward F AO R W ER D
near N IH R
the DH AH
the(2) DH IY
turn T ER N
very V EH R IY
"""

texts = st.text(st.sampled_from("abc ,.!?'\u2019-XYZ"), max_size=30)
phrases = st.lists(st.lists(st.sampled_from(["go", "left", "the", "stop"]), min_size=1, max_size=4), min_size=1)


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("Hello, Robot!", "hello robot"),
        ("  what's   up?", "what's up"),
        ("it\u2019s me", "it's me"),
        ("'quoted'", "quoted"),
        ("good-morning_all", "good morning all"),
        ("...", ""),
        ("cafe\u0301", "caf\u00e9"),
        ("CAFE\u0301!", "caf\u00e9"),
    ],
)
def test_phrase_is_the_spoken_form_of_a_text(text: str, phrase: str) -> None:
    assert normalise(text) == phrase


@given(texts)
def test_normalise_is_idempotent(text: str) -> None:
    assert normalise(normalise(text)) == normalise(text)


@pytest.mark.parametrize(("text", "fault"), [("?!", "no word"), ("go 3 steps", "write them as words"), ("yes", "")])
def test_unspeakable_text_is_reported(text: str, fault: str) -> None:
    assert fault in phrase_error(text)
    assert bool(fault) == bool(phrase_error(text))


def test_grammar_of_unspeakable_text_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot listen for 'go 3 steps': it has digits"):
        PhraseGrammar.from_texts(["yes", "go 3 steps"])


def test_equal_sounding_phrases_count_once() -> None:
    assert PhraseGrammar.from_texts(["Yes!", "yes", "no"]).phrases == ("yes", "no")


@given(phrases)
def test_the_network_allows_just_the_phrases(some: list[list[str]]) -> None:
    grammar = PhraseGrammar.from_texts(" ".join(words) for words in some)
    arcs, found = grammar.arcs(), set()
    walks: list[tuple[int, tuple[str, ...]]] = [(START, ())]
    while walks:
        state, said = walks.pop()
        if state == END:
            found.add(" ".join(said))
        walks += [(to, (*said, word)) for origin, to, _, word in arcs if origin == state]
    assert found == set(grammar.phrases)
    assert sum(chance for origin, _, chance, _ in arcs if origin == START) == pytest.approx(1)


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("Yes.", "yes"),
        ("yes please", "yes"),
        ("oh yes, please", "yes"),
        ("oh yes, I would love to", ""),
        ("yesterday", ""),
        ("well, thank you", "thank you"),
        ("thank her", ""),
        ("", ""),
    ],
)
def test_phrase_is_found_in_a_short_text(text: str, phrase: str) -> None:
    assert PhraseGrammar.from_texts(["yes", "thank you", "no"]).find(text) == phrase


def test_of_several_phrases_in_a_text_the_longest_counts() -> None:
    assert PhraseGrammar.from_texts(["thank", "thank you"]).find("thank you") == "thank you"


@given(texts)
def test_phrase_is_not_found_without_its_words(text: str) -> None:
    assert PhraseGrammar.from_texts(["stop here"]).find(text) == ""


@pytest.mark.parametrize(
    ("american", "british"),
    [
        ("S T AA P", ["S T AO P"]),
        ("S T AA R T", ["S T AA T"]),
        ("F AO R W ER D", ["F AO W AH D"]),
        ("N IH R", ["N IH AH"]),
        ("T ER N", []),
        ("V EH R IY", []),
        ("R EH D", []),
        ("DH AH", []),
        ("AA R B AA T", ["AA B AA T", "AA R B AO T", "AA B AO T"]),
    ],
)
def test_british_speakers_drop_their_r_and_round_their_o(american: str, british: list[str]) -> None:
    assert british_variants(american.split()) == [tuple(each.split()) for each in british]


@given(st.lists(st.sampled_from(sorted(KIND_OF)), min_size=1, max_size=8))
def test_british_variants_are_new_and_keep_the_syllables(phones: list[str]) -> None:
    ways = british_variants(phones)
    assert tuple(phones) not in ways
    assert len(set(ways)) == len(ways)
    for way in ways:
        assert sum(phone in VOWELS for phone in way) >= sum(phone in VOWELS for phone in phones)
        assert set(way) <= KIND_OF.keys()


def test_pronunciations_include_the_dictionary_and_british_variants() -> None:
    lexicon = Lexicon(DICTIONARY)
    assert lexicon.pronunciations("the") == [("DH", "AH"), ("DH", "IY")]
    assert lexicon.pronunciations("stop") == [("S", "T", "AA", "P"), ("S", "T", "AO", "P")]
    assert lexicon.pronunciations("op") == []
    assert lexicon.unknown_words(["stop", "rodney", "very"]) == ["rodney"]


def test_phrases_differing_by_one_sound_are_confusable() -> None:
    lexicon = Lexicon("go G OW\nno N OW\nyes Y EH S\nturn T ER N\nburn B ER N\nup AH P\n")
    assert find_confusable(["go", "no", "yes"], lexicon) == [("go", "no")]
    assert find_confusable(["turn up", "burn up", "burn"], lexicon) == [("turn up", "burn up")]
    assert find_confusable(["yes", "rodney", "rodney go"], lexicon) == []


def test_robot_file_overrides_pronunciations() -> None:
    lexicon = Lexicon(DICTIONARY, {"Rodney": "r aa d n iy", "the": "DH EH"})
    assert lexicon.pronunciations("rodney") == [("R", "AA", "D", "N", "IY"), ("R", "AO", "D", "N", "IY")]
    assert lexicon.pronunciations("the") == [("DH", "EH")]


@pytest.mark.parametrize(("said", "what"), [("R Q", "'Q' is not a phone; phones are AA"), ("", "it has no phones")])
def test_a_pronunciation_with_unknown_phones_is_refused(said: str, what: str) -> None:
    with pytest.raises(ValueError, match=f"pronunciation of 'rodney': {what}"):
        Lexicon("", {"rodney": said})


@pytest.mark.parametrize(
    ("mnemonics", "phones"),
    [
        ("tS 'eI n dZ 3 _: _", "CH EY N JH ER"),
        ("D e@ b 'aI _: _", "DH EH R B AY"),
        ("'E p I2 dZ ,u: r @L _:", "EH P IH JH UW R AH L"),
        ("_: _", ""),
    ],
)
def test_espeak_phonemes_become_phones(mnemonics: str, phones: str) -> None:
    assert " ".join(espeak_to_phones(mnemonics.split())) == phones
    assert set(espeak_to_phones(mnemonics.split())) <= KIND_OF.keys()


def test_phonemes_of_another_language_are_refused() -> None:
    with pytest.raises(ValueError, match="phoneme 'y:' is not one of the voice en-us"):
        espeak_to_phones(["t", "y:"])
