"""A line that is shown again and again stays one line."""

import pytest

from missions.cli.printable import LINE_WIDTH, overwrite_line


def test_a_line_takes_the_place_of_the_one_before_and_never_wraps(capsys: pytest.CaptureFixture[str]) -> None:
    overwrite_line("near")
    overwrite_line("far " * LINE_WIDTH, err=True)
    out, err = capsys.readouterr()
    assert out == "\rnear"  # where there is no terminal, click leaves out what clears the line
    assert err == "\r" + ("far " * LINE_WIDTH)[:LINE_WIDTH]
