"""A Panda behind panda_py 1.1: names, signatures and units (rad, m, s) of the real one.

The arm follows a position controller with a small lag; a jump is a reflex. The hand's calls last until its fingers
stand still, as libfranka's do, so they must come from another thread.
"""

from __future__ import annotations

import threading
from concurrent.futures import Future
from enum import Enum
from types import SimpleNamespace

import numpy as np

from tests.hardware.transports.stepped import Fingers

LAG_S, JUMP_RAD, STATES_AHEAD_S = 0.01, 0.1, 300.0


class RobotMode(Enum):
    kOther = 0
    kIdle = 1
    kMove = 2
    kGuiding = 3
    kReflex = 4
    kUserStopped = 5
    kAutomaticErrorRecovery = 6


class JointPosition:
    def __init__(self, stiffness=None, damping=None, filter_coeff=1.0):
        self.position, self.velocity = None, None

    def set_control(self, position, velocity=(0.0,) * 7):
        assert np.shape(position) == np.shape(velocity) == (7,)
        self.position, self.velocity = np.array(position, float), np.array(velocity, float)


class Panda:
    """The arm; ``pressed`` is its user stop, ``lost`` a pulled cable."""

    def __init__(self, world, q):
        self.world, self.true_q, self.true_dq = world, np.array(q, float), np.zeros(7)
        self.controller, self.mode, self.pressed, self.lost, self.error = None, RobotMode.kIdle, False, False, ""
        self.sent = []
        self.state = self.measure()
        world.on_tick(self.step)

    def measure(self):
        time = SimpleNamespace(to_sec=lambda now=self.world.now_s: STATES_AHEAD_S + now)
        mode = RobotMode.kUserStopped if self.pressed else self.mode
        return SimpleNamespace(
            q=self.true_q.tolist(), dq=self.true_dq.tolist(), tau_ext_hat_filtered=[0.1] * 7, time=time, robot_mode=mode
        )

    def step(self, dt):
        if self.pressed or self.lost:
            self.controller = None
        dq = np.zeros(7)
        if self.controller is not None and self.controller.position is not None:
            away = self.controller.position - self.true_q
            if np.abs(away).max() > JUMP_RAD:
                self.controller, self.mode = None, RobotMode.kReflex
                self.error = "libfranka: Move command aborted: joint_reflex"
            dq = away * (1 - np.exp(-dt / LAG_S)) / dt
        self.true_q, self.true_dq = self.true_q + dq * dt, dq
        if not self.lost:
            self.state = self.measure()

    def get_state(self):
        return self.state

    def start_controller(self, controller):
        if self.lost or self.pressed:
            raise RuntimeError("libfranka: Move command rejected: command not possible in the current mode")
        self.controller, self.mode = controller, RobotMode.kMove
        controller.position = controller.position if controller.position is not None else self.true_q.copy()

    def stop_controller(self):
        self.controller = None
        if self.mode is RobotMode.kMove:
            self.mode = RobotMode.kIdle

    def recover(self):
        if self.lost:
            raise RuntimeError("libfranka: UDP receive: Timeout")
        if self.mode is RobotMode.kReflex and not self.pressed:
            self.mode = RobotMode.kIdle
        self.error = ""

    def raise_error(self):
        if self.lost:
            raise RuntimeError("libfranka: UDP receive: Timeout")
        if self.error:
            raise RuntimeError(self.error)


class Gripper:
    """The hand; ``blocked_at`` of its fingers in metres."""

    def __init__(self, world, width=0.08):
        self.fingers, self.lost, self.grasps, self.calls = Fingers(width, closed_sign=-1), False, False, []
        self.changed, self.busy, self.aborted = threading.Condition(), False, False
        world.on_tick(self.step)

    def submit(self, call):
        """Run a call in a thread, and go on when it waits for the fingers or is over, as real time does by itself."""
        future: Future = Future()

        def run():
            try:
                future.set_result(call())
            except Exception as error:
                future.set_exception(error)
            with self.changed:
                self.changed.notify_all()

        self.future = future
        threading.Thread(target=run, daemon=True).start()
        with self.changed:
            self.changed.wait_for(lambda: self.busy or future.done(), timeout=5)
        return future

    def step(self, dt):
        with self.changed:
            self.fingers.step(dt)
            over = self.busy and not self.fingers.moving
            self.changed.notify_all()
            if over:
                self.changed.wait_for(lambda: self.future.done(), timeout=5)

    def wait_until_still(self):
        with self.changed:
            self.busy = True
            self.changed.notify_all()
            self.changed.wait_for(lambda: not self.fingers.moving, timeout=30)
            self.busy = False
            if self.aborted:
                self.aborted = False
                raise RuntimeError("libfranka gripper: Command aborted!")

    def move(self, width, speed):
        self.calls.append(("move", width, speed))
        self.fingers.go(width, speed)
        self.wait_until_still()
        return bool(abs(self.fingers.position - width) < 1e-6)

    def grasp(self, width, speed, force, epsilon_inner=0.005, epsilon_outer=0.005):
        self.calls.append(("grasp", width, speed, force))
        self.fingers.go(width, speed)
        self.wait_until_still()
        return self.fingers.holding and width - epsilon_inner < self.fingers.position < width + epsilon_outer

    def stop(self):
        with self.changed:
            self.aborted = self.busy
            self.fingers.stop()
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.future.done(), timeout=5)
        return True

    def read_once(self):
        if self.lost:
            raise RuntimeError("libfranka: UDP receive: Timeout")
        return SimpleNamespace(width=self.fingers.position, is_grasped=self.fingers.holding, max_width=0.08)

    def homing(self):
        return True
