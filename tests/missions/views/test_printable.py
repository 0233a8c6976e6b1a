"""Nothing that a terminal obeys reaches it from missions, records, robots, tasks and what users type."""

import io
import json
import re
from pathlib import Path

import pytest
from rich.live import Live
from rich.text import Text

from missions.cli.console import console
from missions.cli.printable import (
    PrintableStream,
    make_all_printable,
    make_printable,
    overwrite_line,
    use_printable_streams,
)
from missions.cli.root import mission, run_guarded
from tests.missions.records.recording.small_record import write
from tests.missions.records.replay.test_malicious_records import ESCAPES, hostile_items

OBEYED = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]|\r(?!\n)")


def test_codes_are_written_out_and_all_else_stays() -> None:
    assert make_printable("a\x1b[31mb\x9bc\u202ed\x7f\r") == "a\\u001b[31mb\\u009bc\\u202ed\\u007f\\u000d"
    assert make_printable("Zoë 愛 שלום\t👩‍🚀\r\n") == "Zoë 愛 שלום\t👩‍🚀\r\n"
    assert json.loads(make_printable(json.dumps({"name": ESCAPES}, ensure_ascii=False))) == {"name": ESCAPES}
    assert make_all_printable({"log": ["\x1b"], "\x1b": 1}) == {"log": ["\\u001b"], "\\u001b": 1}


def test_terminal_keeps_own_colours_and_escapes_those_in_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    raw = io.StringIO()
    shown = console(PrintableStream(raw))  # type: ignore[arg-type] # as sys.stdout is
    shown.print(Text.assemble(("good", "green"), ESCAPES))
    with Live(console=shown, auto_refresh=False) as live:
        live.update(Text(ESCAPES), refresh=True)
    written = raw.getvalue()
    assert "\x1b[32mgood" in written
    assert "\x1b]0;" not in written
    assert not re.search("[\x7f-\x9f\u202e\u2066]", written)
    assert written.count("\\u001b]0;owned") == 3  # the live line is drawn twice


def test_overwritten_line_is_printable(capsys: pytest.CaptureFixture[str]) -> None:
    with use_printable_streams():
        overwrite_line("\x1b[2Jhi")
    assert capsys.readouterr().out in {
        "\r\x1b[K\\u001b[2Jhi",
        "\r\\u001b[2Jhi",
    }  # without a terminal, click strips ours


def outputs(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run the command as a process does it; return all that it prints."""
    with use_printable_streams():
        run_guarded(lambda: mission.main(list(arguments), standalone_mode=False))
    printed = capsys.readouterr()
    return printed.out + printed.err


def test_no_command_prints_escape_sequences_of_texts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    quoted = json.dumps(ESCAPES)
    (tmp_path / "evil.yaml").write_text(
        f"mission: {quoted}\nsummary: {quoted}\nparams: {{text: {quoted}}}\n"
        f"tree: {{sequence: [{{log: {quoted}}}, {{say: {quoted}}}, {{fail: {quoted}, name: {quoted}}}]}}\n"
    )
    (tmp_path / "wrong.yaml").write_text(f"mission: m\ntree: {{sequence: [{{{quoted}: 1}}, {{wait: {quoted}}}]}}\n")
    (tmp_path / "robot.yaml").write_text(f"robot: {quoted}\n{quoted}: 1\n")
    record = str(write(tmp_path / "evil.mcap", hostile_items()))
    printed: dict[str, str] = {}
    for words in (
        ("run", "evil.yaml", "--simulate", "fast"),
        ("run", "evil.yaml", "--simulate", "fast", "--json"),
        ("run", "evil.yaml", "--param", f"text={ESCAPES}", "--simulate", "fast"),
        ("run", ESCAPES),
        (ESCAPES,),
        ("run", "greet", "--robot", ESCAPES),
        ("run", "greet", "--robot", "robot.yaml", "--simulate"),
        ("check", "evil.yaml", "wrong.yaml"),
        ("check", "--json", "wrong.yaml"),
        ("show", "evil.yaml"),
        ("show", "evil.yaml", "--format", "json"),
        ("show", record, "--at", "1s"),
        ("verify", "evil.yaml"),
        ("test", "evil.yaml"),
        ("record", "replay", record),
        ("record", "rerun", record),
        ("record", "info", record),
        ("record", "stats", record),
        ("record", "stats", "--json", record),
        ("record", "report", record),
        ("record", "joints", record),
        ("record", "compare", record, record),
        ("task", "add", "evil.yaml", "--simulate", "fast"),
        ("task", "serve", "--once"),
        ("task", "list"),
        ("task", "log", "1"),
        ("show", "behaviour", ESCAPES),
        ("list", ESCAPES),
        ("show", ESCAPES),
        ("see", ESCAPES),
        ("person", "list", ESCAPES),
        ("hear", "--for", ESCAPES, "--wav", ESCAPES),
        ("controller", "show", ESCAPES),
    ):
        printed[" ".join(words)[:60]] = outputs(capsys, *words)
    wrong = {words: found[0] for words, said in printed.items() if (found := OBEYED.search(said))}
    assert not wrong
    assert all(printed.values()), "each says something"
