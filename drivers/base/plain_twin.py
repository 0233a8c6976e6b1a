"""The twin of a base on two wheels that feels nothing, and may not even measure how far they have turned."""

from dataclasses import replace
from typing import Unpack

from drivers.api import STILL, BaseState, Odometers, Velocity
from drivers.base.arbitrated import BaseSettings
from drivers.base.gyro_bias import GyroBias
from drivers.base.progress_monitor import Instruments
from drivers.base.reckoning import Reckoning, TwoWheels
from drivers.base.twin import BaseTwin, Contacts
from drivers.clock import Clock
from drivers.sim.body import NOTHING, Body


class PlainTwin(BaseTwin):
    """A ``drivers.api.Base`` made of arithmetic, as ``drivers.base.plain_base.PlainBase``; see ``BaseTwin``.

    Whatever ``body`` bumps into, it does not feel it. Where it is ``reckoned``, its pose is what it was told, added up;
    without a ``gauge`` it measures no battery.
    """

    instruments = Instruments("encoders", "encoders")

    def __init__(
        self,
        clock: Clock,
        *,
        wheels: TwoWheels,
        reckoned: bool,
        gauge: bool = True,
        gyro: bool = False,
        body: Body | None = None,
        dropouts: float = 0.0,
        seed: int = 0,
        **settings: Unpack[BaseSettings],
    ) -> None:
        super().__init__(clock, body=body, dropouts=dropouts, seed=seed, capabilities=(), **settings)
        self._wheels = wheels
        self._reckoned = reckoned
        self._gauge = gauge
        self._gyro = gyro
        self._bias = GyroBias(encoders=False)
        self._commanded = False
        self._reckoning = Reckoning()

    @property
    def _course(self) -> Reckoning:
        return self._reckoning

    def _anchor(self) -> None:
        self._reckoning.pause()

    def _measure(self, now: float) -> None:
        if self._reckoned:
            self._reckoning.advance(now)
            return
        self.late.put(now, (now, self._rolls()))
        for at, rolls in self.late.due(now):
            self._reckoning.advance(at, self._corrected(rolls) if self._gyro else rolls)

    def _rolls(self) -> Velocity:
        """Return how it moves by its encoders, whether its wheels slip or not, and by its gyro, where it has one."""
        left, right = self.body.counters.speeds
        drift = self.body.gyro.rate if self._gyro else 0.0
        return Velocity((left + right) / 2, (right - left) / self.body.wheels.separation + drift)

    def _corrected(self, rolls: Velocity) -> Velocity:
        """Return a velocity without the bias of the gyro."""
        still = not self._commanded and rolls.linear == 0.0
        turn, _ = self._bias.correct(rolls.angular * self.PERIOD, rolls.angular, self.PERIOD, still=still)
        return Velocity(rolls.linear, turn / self.PERIOD)

    def _touches(self) -> Contacts:
        return NOTHING, NOTHING, NOTHING, frozenset(), frozenset(), False

    def _obey(self, velocity: Velocity, now: float) -> None:
        self._commanded = velocity != STILL
        given = self._wheels.within(velocity)
        self.body.command(given.linear, given.angular, now)
        if self._reckoned:
            self._reckoning.advance(now, given)

    def _state(self) -> BaseState:
        state = replace(
            super()._state(),
            reckoned=self._reckoned,
            settling=self._bias.settling,
            odometers=self._odometers(),
        )
        return state if self._gauge else replace(state, battery_voltage=0.0, battery_percent=100.0, charging=False)

    def _odometers(self) -> Odometers | None:
        """Return what its wheels counted; None where nothing counts them, or only a fused pose is told."""
        if self._reckoned or self._gyro:
            return None
        left, right = self.body.counters.travel
        return Odometers(left, right, (right - left) / self.body.wheels.separation)
