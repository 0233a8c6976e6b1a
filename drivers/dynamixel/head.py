"""A head of two Dynamixel servos on the arm's bus: leads them on a thread of its own."""

from threading import Event, Thread

from drivers.api import Joints, Notice
from drivers.joints_head import PERIOD, JointsHead


class DynamixelHead(JointsHead[Joints]):
    """A ``JointsHead`` that steps itself while it is open. The arm's driver, which owns the bus, is opened besides."""

    _ending: Event | None = None
    _thread: Thread | None = None

    def open(self) -> None:
        """Use the joints as soon as they are there; does nothing while it is open."""
        if self._thread is None:
            super().open()
            self._ending = Event()
            self._thread = Thread(target=self._run, args=(self._ending,), name=f"{self.name} joints", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and hold. Safe from any state, more than once."""
        if self._thread is not None and self._ending is not None:
            self._ending.set()
            self._thread.join()
            self._thread = None
        super().close()

    def _run(self, ending: Event) -> None:
        fault = ""
        while not ending.wait(PERIOD):
            try:
                self.step()
            except BaseException as error:  # SystemExit too: without this thread the head would not even brake
                if (new := f"{type(error).__name__}: {error}") != fault:
                    fault = new
                    self._report(Notice(self.name, "fault", fault))
