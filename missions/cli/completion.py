"""``mission completion``: the names that a shell completes behind ``mission``, and how it comes to know them."""

import os
import shlex
from pathlib import Path
from typing import Any

import click
from click.shell_completion import (
    BashComplete,
    CompletionItem,
    ZshComplete,
    add_completion_class,
    get_completion_class,
    split_arg_string,
)

from config.file_io import save_file
from missions.cli.outputs import report_write_errors
from missions.cli.root import COMPLETION_VARIABLE, SUCCESS, mission
from missions.library.folders import data_folder

SHELLS = ("bash", "zsh", "fish")

ZSH_PRELUDE = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n"
"""A zsh that was never set up has no completion at all."""


class BashCompletion(BashComplete):
    """Completion for bash, which takes ``to=Anna`` for three words and puts no quotes around what it completes."""

    source_template = BashComplete.source_template.replace(
        "COMPREPLY+=($value)",
        'COMPREPLY+=("$value")\n            [[ $value == *= ]] && compopt -o nospace',
    )

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the one that is completed, and that one, with what "=" parted put together."""
        words = [""]
        for word in [*split_arg_string(os.environ["COMP_WORDS"]), ""][: int(os.environ["COMP_CWORD"]) + 1]:
            if word == "=" or words[-1].endswith("="):
                words[-1] += word
            else:
                words.append(word)
        return words[2:-1], words[-1]

    def format_completion(self, item: CompletionItem[Any]) -> str:
        """Return an item as the script reads it: of ``to=Anna`` only what stands behind the sign, as bash wants it."""
        value = str(item.value)
        value = value.partition("=")[2] or value
        return f"{item.type},{shlex.quote(value) if item.type == 'plain' else value}"


class ZshCompletion(ZshComplete):
    """Completion for zsh, which is not to put a space behind ``to=``."""

    source_template = ZshComplete.source_template.replace(
        "_describe -V unsorted completions_with_descriptions -U",
        "local -a behind=(); [[ $response[2] == *= ]] && behind=(-S '')\n"
        '        _describe -V unsorted completions_with_descriptions -U "${behind[@]}"',
    )


for each in (BashCompletion, ZshCompletion):
    add_completion_class(each)


@click.group(epilog="Example: mission completion install")
def command() -> None:
    """Let the shell complete commands, options, missions, robots, worlds, people, params and gestures with TAB."""


@command.command(epilog="Example: mission completion show zsh")
@click.argument("shell", type=click.Choice(SHELLS))
def show(shell: str) -> None:
    """Print the script that a shell needs."""
    click.echo(completion_script(shell), nl=False)


@command.command(epilog="Example: mission completion install --shell bash")
@click.option("--shell", type=click.Choice(SHELLS), help="Which one, if not that of $SHELL.")
def install(shell: str | None) -> int:
    """Let your shell complete what follows `mission`: a script, and for bash and zsh a line that reads it."""
    shell = shell or Path(os.environ.get("SHELL", "")).name
    if shell not in SHELLS:
        raise click.UsageError(
            f"the shell ($SHELL) is {shell or 'not set'}\n  try: mission completion install --shell bash"
        )
    if shell == "fish":
        config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
        path, started = config / "fish" / "completions" / "mission.fish", None
    else:
        path = data_folder() / f"completion.{shell}"
        started = (
            Path(os.environ.get("ZDOTDIR") or Path.home()) / ".zshrc" if shell == "zsh" else Path.home() / ".bashrc"
        )
    with report_write_errors(path, "--shell"):
        path.parent.mkdir(parents=True, exist_ok=True)
        save_file(path, completion_script(shell))
    added = started is not None and _append_line(
        started, f"[ -r {shlex.quote(str(path))} ] && . {shlex.quote(str(path))}"
    )
    click.echo(
        f"terminals that are opened from now on complete `mission`; for this one: source {shlex.quote(str(path))}"
    )
    click.echo(f"wrote {path}" + (f", and a line at the end of {started}" if added else ""))
    return SUCCESS


def completion_script(shell: str) -> str:
    """Return the script of a shell."""
    found = get_completion_class(shell)
    if found is None:
        raise ValueError(shell)
    return (ZSH_PRELUDE if shell == "zsh" else "") + found(
        mission, {}, "mission", COMPLETION_VARIABLE
    ).source().lstrip()


def _append_line(file: Path, line: str) -> bool:
    """Add a line to a file that a shell reads when it starts, unless it is there; say whether it was added."""
    with report_write_errors(file, "--shell"):
        text = file.read_text(encoding="utf-8", errors="surrogateescape") if file.exists() else ""
        if line in text.splitlines():
            return False
        with file.open("a", encoding="utf-8") as out:
            out.write("\n" * (not text.endswith("\n") and bool(text)) + line + "\n")
    return True
