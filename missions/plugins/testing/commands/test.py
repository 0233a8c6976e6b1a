"""``mission test``: runs the cases of test files and reports the failures."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from config.diagnostics import Diagnostic, InvalidFileError
from config.file_io import save_file
from drivers.clock import SystemClock
from missions.cli.console import console, echo
from missions.cli.names import TESTED_NAME
from missions.cli.numbers import WholeNumber
from missions.cli.option_declarations import behaviours_option
from missions.cli.options import print_found_files
from missions.cli.origin import OTHER_ROBOT_OF_TESTS, chosen_robot
from missions.cli.outputs import report_write_errors
from missions.cli.root import FAILURE, SUCCESS
from missions.library.shipped import behaviour_files
from missions.plugins.testing import report
from missions.plugins.testing.case_verdict import CaseVerdict
from missions.plugins.testing.report import coverage, coverage_lines, coverage_page, junit
from missions.plugins.testing.suite import Case, all_tests, find_tests, load_suite
from missions.plugins.testing.worker_pool import core_count, play_all


@click.command(epilog="Example: mission test greet --coverage")
@click.argument("names", type=TESTED_NAME, nargs=-1, metavar="[PATH]...")
@click.option(
    "-k", "words", metavar="TEXT", default="", help="Run only the cases with this text in their file or title."
)
@click.option("--physics", is_flag=True, help="Simulate physics in all cases, as with `physics: true`.")
@click.option(
    "-j", "--jobs", type=WholeNumber(min=1), metavar="N", help="Number of processes; the default is one for each core."
)
@click.option(
    "--junit",
    "junit_file",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the verdicts as JUnit XML to this file.",
)
@click.option("--coverage", "tell_coverage", is_flag=True, help="Print the nodes and endings that no case has reached.")
@click.option(
    "--coverage-page",
    "page_file",
    metavar="FILE.html",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the coverage as an HTML page to this file, with the missions' lines marked.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
@behaviours_option
@click.option("-x", "--fail-fast", is_flag=True, help="Stop after the first failure.")
def command(
    names: tuple[str, ...],
    words: str,
    physics: bool,
    jobs: int | None,
    junit_file: Path | None,
    tell_coverage: bool,
    page_file: Path | None,
    as_json: bool,
    files: tuple[Path, ...],
    fail_fast: bool,
) -> int:
    """Run test files, in simulated time: files, folders, or missions by name.

    Without arguments: the test files in this folder and below; if there are none, those shipped with MissionTree. Exit
    codes: 0 all cases passed; 1 a case failed; 2 an error in the command or a file.
    """
    chosen_robot(None, OTHER_ROBOT_OF_TESTS)  # of the cases that name none
    cases = _select_cases(names, words, files)
    if physics:
        cases = [replace(case, physics=True) for case in cases]
    clock = SystemClock()
    with _progress(len(cases)) as on_verdict:
        verdicts = _play_cases(cases, jobs or core_count(), fail_fast, on_verdict)
    if junit_file is not None:
        _write(junit_file, junit(verdicts), "--junit")
    if page_file is not None:
        _write(page_file, coverage_page(coverage(verdicts)).encode(), "--coverage-page")
    if as_json:
        click.echo(json.dumps([report.as_dict(verdict) for verdict in verdicts], indent=2, ensure_ascii=False))
    else:
        _print_verdicts(verdicts)
        if tell_coverage:
            click.echo("\n" + "\n".join(coverage_lines(coverage(verdicts))) + "\n")
    click.echo(report.summary_line(verdicts, planned=len(cases), seconds=clock.now()), err=as_json)
    if written := [str(path) for path in (junit_file, page_file) if path is not None]:
        click.echo(f"wrote {', '.join(written)}", err=True)
    return SUCCESS if all(verdict.passed for verdict in verdicts) else FAILURE


def _select_cases(names: Sequence[str], words: str, own: Sequence[Path]) -> list[Case]:
    """Return the cases to run: those of the test files ``names`` that have ``words`` in their file name or title.

    ``own`` are additional files of behaviours. Raises InvalidFileError with all errors.
    """
    files = dict.fromkeys(path for name in names for path in find_tests(name)) if names else all_tests()
    cases: list[Case] = []
    faults: list[Diagnostic] = []
    for path in files:
        try:
            cases += load_suite(path, own)
        except InvalidFileError as error:
            faults += error.diagnostics
    if faults:
        raise InvalidFileError(faults)
    for mission in dict.fromkeys(case.mission for case in cases):
        print_found_files(behaviour_files(mission, own), own)
    chosen = [case for case in cases if words.lower() in f"{case.source.name}: {case.title}".lower()]
    if not chosen:
        raise click.UsageError(f"-k: none of {len(cases)} cases has '{words}' in its file or title")
    return chosen


def _play_cases(
    cases: Sequence[Case], jobs: int, fail_fast: bool, on_verdict: Callable[[CaseVerdict], None]
) -> list[CaseVerdict]:
    verdicts: list[CaseVerdict] = []
    with closing(play_all(cases, jobs=jobs)) as playing:
        for verdict in playing:
            verdicts.append(verdict)
            on_verdict(verdict)
            if fail_fast and not verdict.passed:
                break
    return report.sort_verdicts(verdicts)


def _print_verdicts(verdicts: Sequence[CaseVerdict]) -> None:
    for verdict in verdicts:
        if verdict.passed:
            echo("passed", "green", f"  {verdict.case}")
    for verdict in verdicts:
        if not verdict.passed:
            echo("\nFAILED", "red", f"  {report.failure_text(verdict)}\n")


@contextmanager
def _progress(count: int) -> Iterator[Callable[[CaseVerdict], None]]:
    """Show a progress bar on a terminal, and yield the function that reports a verdict; otherwise show nothing."""
    shown = console(sys.stderr)
    if not shown.is_terminal:
        yield lambda _: None
        return
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("[red]{task.fields[failed]}"), TimeElapsedColumn())
    with Progress(*columns, console=shown, transient=True) as progress:
        task = progress.add_task("cases", total=count, failed="")
        failed: list[CaseVerdict] = []

        def on_verdict(verdict: CaseVerdict) -> None:
            failed.extend(() if verdict.passed else (verdict,))
            progress.update(task, advance=1, failed=f"{len(failed)} failed" if failed else "")

        yield on_verdict


def _write(path: Path, data: bytes, option: str) -> None:
    with report_write_errors(path, option):
        save_file(path, data)
