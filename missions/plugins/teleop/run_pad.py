"""``mission run --pad``: a game pad beside a mission."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import click

from missions.cli.session import RunSession
from missions.plugins.teleop import FIRST_PAD
from missions.plugins.teleop.beside import Beside
from missions.plugins.teleop.options import PadOptions
from missions.plugins.teleop.pad import pad_at


@contextmanager
def pad_beside(options: PadOptions, session: RunSession) -> Iterator[None]:
    """Let a game pad drive the base of a run. Raises click.UsageError without a base."""
    runner = session.runner
    base = runner.assembled.robot.base_part
    if base is None:
        raise click.UsageError(f"--pad drives the base, which {runner.plan.mission} does not use")
    pad = Beside(base, partial(pad_at, options.pad or FIRST_PAD, runner.clock), runner.clock, report=runner.report)
    runner.assembled.devices[pad.name] = pad
    yield
