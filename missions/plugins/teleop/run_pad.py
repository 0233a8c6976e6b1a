"""``mission run --pad``: a game pad during a mission."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import click

from missions.cli.session import RunSession
from missions.plugins.teleop import FIRST_PAD
from missions.plugins.teleop.hand_driving import PadDevice
from missions.plugins.teleop.options import PadOptions
from missions.plugins.teleop.pad import make_pad


@contextmanager
def drive_with_pad(options: PadOptions, session: RunSession) -> Iterator[None]:
    """Let a game pad drive the base of a run. Raises click.UsageError without a base."""
    runner = session.runner
    base = runner.assembled_robot.robot.base_part
    if base is None:
        raise click.UsageError(f"--pad drives the base, which {runner.plan.mission} does not use")
    pad = PadDevice(base, partial(make_pad, options.pad or FIRST_PAD, runner.clock), runner.clock, report=runner.report)
    runner.assembled_robot.devices[pad.name] = pad
    yield
