"""What a run does when sensors have become true: rare, so in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mbsim.arrays.codes import FIRED, NEXT, SHOWN
from mbsim.compile_model.build import System
from mbsim.integrators import scheme
from mbsim.model.elements import Sensor
from mbsim.model.names import element_name
from mbsim.results.log import number

GO_ON, RETURN, HALT = range(3)


class Sensing:
    """The actions of sensors, and what they may change for the rest of a Simulate.

    Attributes
    ----------
    times : ndarray
        Output times of the Simulate, those passed included.
    h_max : float
        Its longest step.
    halted_by : int
        Sensor that ended the run, 0 for none.
    """

    def __init__(
        self, system: System, method: scheme.Method, log: Any, tell: Callable[[str], None]
    ) -> None:
        self.system, self.method, self.log, self.tell = system, method, log, tell
        self.times = np.zeros(0)
        self.h_max = 0.0
        self.halted_by = 0

    def begin(self, times: Any, h_max: float) -> None:
        """Start a Simulate."""
        self.times, self.h_max = times, h_max

    def saved(self) -> dict[str, Any]:
        """Return what a resumed run needs."""
        if not self.system.model.sensors:
            return {}
        return {"sensing/times": self.times, "sensing/h_max": np.array(self.h_max)}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go back to a checkpoint."""
        if self.system.model.sensors:
            self.begin(np.array(saved["sensing/times"]), float(saved["sensing/h_max"]))

    def act(self, t: float, end: float, last: bool) -> tuple[int, bool]:
        """Do what the sensors that became true at t ask for; return what follows, and a row or not.

        Parameters
        ----------
        t, end : float
            Now, and the end of the Simulate.
        last : bool
            No other Simulate follows: the last row is this one's.
        """
        sensed, memory = self.system.scene.state.sensed, self.method.memory
        sensors = list(self.system.model.sensors.values())
        follows, row = GO_ON, False
        for k in np.flatnonzero(sensed[:, FIRED]):
            sensor = sensors[k]
            sensed[k, FIRED] = 0.0
            if sensor.evaluate is not None:
                sensed[k, SHOWN] = sensed[k, NEXT]
            if sensor.h_max is not None:
                self.h_max = sensor.h_max
            if sensor.stepsize is not None:
                memory[scheme.STEP] = sensor.stepsize
            if sensor.dt is not None:
                self._print_every(sensor.dt, t, end, last)
            row = row or sensor.prints
            if sensor.halt and follows != HALT:
                self.halted_by = sensor.id
            follows = max(follows, HALT if sensor.halt else RETURN if sensor.stops else GO_ON)
            line = self._told(sensor, t, float(sensed[k, SHOWN]))
            self.log.line(line)
            if sensor.verbose:
                self.tell(line)
        # forces may look at what SENVAL shows
        memory[scheme.HAVE_F] = 0.0
        coming = int(self.method.counts[scheme.NEXT_OUTPUT])
        planned = coming < len(self.times) and self.times[coming] == t
        if follows == GO_ON:
            return follows, row and not planned
        # the Simulate that follows begins with a row
        return follows, follows == HALT or last

    def _print_every(self, dt: float, t: float, end: float, last: bool) -> None:
        """Put rows at t + dt, t + 2 dt, ... in the place of those to come."""
        coming = int(self.method.counts[scheme.NEXT_OUTPUT])
        passed = self.times[:coming]
        if coming < len(self.times) and self.times[coming] == t:
            passed = self.times[: coming + 1]
        times = t + dt * np.arange(1, int((end - t) / dt * (1.0 + 1e-12) + 1e-9) + 1)
        times = times[times < end - 1e-9 * dt]
        self.times = np.concatenate([passed, times, [end] if last else []])

    def _told(self, sensor: Sensor, t: float, shown: float) -> str:
        """Return the line of the log."""
        name = element_name(self.system.model.file, "Sensor_Event", sensor.id)
        actions = [
            ("evaluates", None if sensor.evaluate is None else number(shown)),
            ("prints a row", "" if sensor.prints else None),
            ("prints every", None if sensor.dt is None else number(sensor.dt)),
            ("next step", None if sensor.stepsize is None else number(sensor.stepsize)),
            ("longest step", None if sensor.h_max is None else number(sensor.h_max)),
            ("ends this Simulate", "" if sensor.stops else None),
            ("halts the run", "" if sensor.halt else None),
        ]
        done = ", ".join(f"{what} {how}".rstrip() for what, how in actions if how is not None)
        return f"{name}: true at time {t:.12g}" + (f"; {done}" if done else "")
