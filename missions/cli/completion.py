"""``mission completion``: shell completion for bash, zsh and fish."""

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
"""Start of the script for zsh: it loads the completion system, which a fresh zsh does not do."""


class BashCompletion(BashComplete):
    """Completion for bash, which splits ``to=Anna`` into three words and does not quote completed words."""

    source_template = BashComplete.source_template.replace(
        "COMPREPLY+=($value)",
        'COMPREPLY+=("$value")\n            [[ $value == *= ]] && compopt -o nospace',
    )

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the incomplete word, and that word; parts that bash split at "=" are joined."""
        words = [""]
        for word in [*split_arg_string(os.environ["COMP_WORDS"]), ""][: int(os.environ["COMP_CWORD"]) + 1]:
            if word == "=" or words[-1].endswith("="):
                words[-1] += word
            else:
                words.append(word)
        return words[2:-1], words[-1]

    def format_completion(self, item: CompletionItem[Any]) -> str:
        """Return a completion in the form that the bash script reads: its type and value.

        Of ``to=Anna`` only the part after "=" is returned, as bash expects.
        """
        value = str(item.value)
        value = value.partition("=")[2] or value
        return f"{item.type},{shlex.quote(value) if item.type == 'plain' else value}"


class ZshCompletion(ZshComplete):
    """Completion for zsh, without a space after ``to=``."""

    source_template = ZshComplete.source_template.replace(
        "_describe -V unsorted completions_with_descriptions -U",
        "local -a behind=(); [[ $response[2] == *= ]] && behind=(-S '')\n"
        '        _describe -V unsorted completions_with_descriptions -U "${behind[@]}"',
    )


for each in (BashCompletion, ZshCompletion):
    add_completion_class(each)


@click.group(epilog="Example: mission completion install")
def command() -> None:
    """Set up completion of commands, options, missions, robots, worlds, people, params and gestures with TAB."""


@command.command(epilog="Example: mission completion show zsh")
@click.argument("shell", type=click.Choice(SHELLS))
def show(shell: str) -> None:
    """Print the completion script of a shell."""
    click.echo(completion_script(shell), nl=False)


@command.command(epilog="Example: mission completion install --shell bash")
@click.option("--shell", type=click.Choice(SHELLS), help="Shell; the default is that of $SHELL.")
def install(shell: str | None) -> int:
    """Install completion for your shell.

    Writes a script, and for bash and zsh a line that loads it.
    """
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
    click.echo(f"new terminals complete `mission`; for this one: source {shlex.quote(str(path))}")
    click.echo(f"wrote {path}" + (f", and a line at the end of {started}" if added else ""))
    return SUCCESS


def completion_script(shell: str) -> str:
    """Return the completion script of a shell. Raises ValueError for an unknown shell."""
    found = get_completion_class(shell)
    if found is None:
        raise ValueError(shell)
    return (ZSH_PRELUDE if shell == "zsh" else "") + found(
        mission, {}, "mission", COMPLETION_VARIABLE
    ).source().lstrip()


def _append_line(file: Path, line: str) -> bool:
    """Append a line to a start file of a shell unless it is present; return whether it was appended."""
    with report_write_errors(file, "--shell"):
        text = file.read_text(encoding="utf-8", errors="surrogateescape") if file.exists() else ""
        if line in text.splitlines():
            return False
        with file.open("a", encoding="utf-8") as out:
            out.write("\n" * (not text.endswith("\n") and bool(text)) + line + "\n")
    return True
