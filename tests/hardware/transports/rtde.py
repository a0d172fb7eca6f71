"""A UR controller behind the classes of ur-rtde 1.6: signatures, units (rad, s) and behaviour as in its documentation.

``servoJ`` is followed with the lag of its look-ahead; a target out of reach is a protective stop; the watchdog ends the
control program; in an emergency stop the program dies and ``reuploadScript`` works only when that is over.
"""

from __future__ import annotations

import numpy as np

SPEED_LIMIT = 3.3
JUMP_RAD = 0.3


class Controller:
    """The box: ``fault`` is what a person or the network does to it."""

    def __init__(self, world, q):
        self.world = world
        self.q, self.dq = np.array(q, float), np.zeros(6)
        self.target, self.servoing, self.brake = self.q.copy(), False, 0.0
        self.program, self.protective, self.emergency, self.connected, self.frozen = True, False, False, True, False
        self.watchdog_s, self.kicked_s, self.lookahead, self.sent = None, 0.0, 0.03, []
        self.seen = (0.0, self.q.copy(), self.dq.copy())
        world.on_tick(self.step)

    def step(self, dt):
        now = self.world.now_s
        if self.watchdog_s and self.program and now - self.kicked_s > self.watchdog_s:
            self.program = False
        if not self.connected and now - self.kicked_s > 0.1:
            self.program = False
        if self.emergency or self.protective:
            self.program = False
        if self.servoing and self.program:
            aim = self.q + (1 - np.exp(-dt / self.lookahead)) * (self.target - self.q)
            dq = (aim - self.q) / dt
            if (np.abs(dq) > SPEED_LIMIT * 1.2).any():
                self.protective = True
        else:
            self.servoing = False
            size = np.abs(self.dq).max()
            dq = self.dq * max(0.0, 1 - 20.0 * dt / size) if size > 1e-9 else np.zeros(6)
        self.dq = dq
        self.q = self.q + dq * dt
        if not self.frozen:
            self.seen = (now, self.q.copy(), self.dq.copy())


class RTDEControlInterface:
    def __init__(self, box):
        self._box = box

    def servoJ(self, q, speed, acceleration, time, lookahead_time, gain):
        assert [type(x) for x in q] == [float] * 6
        assert 0.03 <= lookahead_time <= 0.2
        assert 100 <= gain <= 2000
        assert time > 0
        box = self._box
        if not box.connected:
            raise RuntimeError("lost connection to robot")
        if not box.program:
            return False
        box.sent.append((box.world.now_s, np.array(q)))
        if np.abs(np.array(q) - box.q).max() > JUMP_RAD:
            box.protective = True
        box.target, box.servoing, box.lookahead = np.array(q), True, lookahead_time
        return True

    def servoStop(self, a=10.0):
        if not self._box.connected:
            raise RuntimeError("lost connection to robot")
        self._box.servoing = False
        return True

    def stopJ(self, a=2.0, asynchronous=False):
        self.servoStop(a)

    def setWatchdog(self, min_frequency=10.0):
        self._box.watchdog_s, self._box.kicked_s = 1 / min_frequency, self._box.world.now_s
        return True

    def kickWatchdog(self):
        self._box.kicked_s = self._box.world.now_s
        return True

    def isConnected(self):
        return self._box.connected

    def isProgramRunning(self):
        return self._box.program

    def reuploadScript(self):
        box = self._box
        if not box.connected or box.emergency or box.protective:
            return False
        box.program, box.kicked_s = True, box.world.now_s
        return True

    def stopScript(self):
        self._box.program = False

    def disconnect(self):
        self._box.connected = False


class RTDEReceiveInterface:
    def __init__(self, box):
        self._box = box

    def isConnected(self):
        return self._box.connected

    def getTimestamp(self):
        """Seconds since the controller was started, which was long ago."""
        return 5000.0 + self._box.seen[0]

    def getActualQ(self):
        return self._box.seen[1].tolist()

    def getActualQd(self):
        return self._box.seen[2].tolist()

    def getTargetMoment(self):
        return [0.0, -40.0, -15.0, -1.0, 0.0, 0.0]

    def isEmergencyStopped(self):
        return self._box.emergency

    def isProtectiveStopped(self):
        return self._box.protective

    def getSafetyStatusBits(self):
        return 1 | (self._box.protective << 2) | (self._box.emergency << 7)

    def getRobotMode(self):
        return 3 if self._box.emergency else 7

    def disconnect(self):
        self._box.connected = False
