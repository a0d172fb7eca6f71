"""How evenly the adapters command their devices: ``python -m benchmarks.adapters --seconds 20``.

Each arm moves to and fro in real time against the fake of its transport; what arrives there is stamped. Prints one JSON
row for each: messages a second, the intervals between them, and how many beats were left out. The Kinova's go over a
loopback WebSocket to a fake rosbridge; the others are calls. ``--realtime True`` asks the kernel to run this process
before all ordinary ones (SCHED_FIFO; needs the right to), as one would on the computer of a robot.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable

import numpy as np

from benchmarks._common import machine
from tests.hardware.transports import panda as fake_panda
from tests.hardware.transports import rtde
from tests.hardware.transports.rosbridge import RosbridgeServer
from tr_grasp.hardware.adapters import kinova
from tr_grasp.hardware.adapters.panda import PandaCfg, PandaLink
from tr_grasp.hardware.adapters.streamed_arm import StreamedArm
from tr_grasp.hardware.adapters.ur import UrCfg, UrLink
from tr_grasp.hardware.real_world import RealWorld
from tr_grasp.motion import MotionLimits, time_optimal
from tr_grasp.robots import robot_spec

WAY_RAD = 0.2
STALL = 1.5
"""Intervals of so many periods and more are stalls."""


class SteppingWorld(RealWorld):
    """Real time in which fakes are stepped, as a device steps itself."""

    def on_tick(self, listener: Callable[[float], None]) -> None:
        """Step a fake 250 times a second."""
        self.at_close(self.every(0.004, lambda: listener(0.004)))


def ur5(world: SteppingWorld) -> tuple[StreamedArm, list[float]]:
    """An arm and the times at which its fake was told something."""
    spec, times = robot_spec("ur5_rg2"), []
    box = rtde.Controller(world, spec.home_q_rad)

    class Control(rtde.RTDEControlInterface):
        def servoJ(self, *arguments):
            times.append(time.perf_counter())
            return super().servoJ(*arguments)

    link = UrLink(Control(box), rtde.RTDEReceiveInterface(box), UrCfg("fake"), world)
    return StreamedArm(spec.name, MotionLimits.of(spec), link, world), times


def panda(world: SteppingWorld) -> tuple[StreamedArm, list[float]]:
    """As :func:`ur5`."""
    spec, times = robot_spec("panda"), []

    class Controller(fake_panda.JointPosition):
        def set_control(self, position, velocity=(0.0,) * 7):
            times.append(time.perf_counter())
            super().set_control(position, velocity)

    link = PandaLink(fake_panda.Panda(world, spec.home_q_rad), Controller, PandaCfg("fake"), world)
    return StreamedArm(spec.name, MotionLimits.of(spec), link, world), times


class _Times(list):
    """What the fake driver hears, as times of arrival."""

    def __init__(self, server: RosbridgeServer) -> None:
        self._server = server

    def __iter__(self):
        return iter([arrival for arrival, _ in self._server.driver.heard])


def j2s7s300(world: SteppingWorld) -> tuple[StreamedArm, list[float]]:
    """As :func:`ur5`."""
    spec = robot_spec("j2s7s300")
    server = RosbridgeServer(spec.home_q_rad, lambda: world.now_s)
    world.at_close(server.close)
    world.at_close(world.every(0.01, lambda: server.step() and None))
    arm = kinova.open_arm(spec, kinova.KinovaCfg("127.0.0.1", server.port), world)
    return arm, _Times(server)


ARMS = {"ur5": (ur5, 125.0), "j2s7s300": (j2s7s300, 100.0), "panda": (panda, 250.0)}


def row(name: str, seconds: float) -> dict:
    """Of one arm."""
    opened, rate_hz = ARMS[name]
    with SteppingWorld() as world:
        arm, times = opened(world)
        world.at_close(arm.close)
        home, moves, faults = arm.commanded().q, 0, 0
        begun = time.perf_counter()
        while time.perf_counter() - begun < seconds:
            goal = home + WAY_RAD * (moves % 2 == 0) * np.sign((arm.limits.lower_rad + arm.limits.upper_rad) / 2 - home)
            command = arm.move(time_optimal(np.stack([arm.commanded().q, goal]), arm.limits).trajectory.slower(1.5))
            while not command.done:
                world.wait(0.02)
            moves, faults = moves + 1, faults + (not command.result.succeeded)
        stamps = np.array(sorted(times))
    stamps = stamps[stamps > begun]
    gaps = 1e3 * np.diff(stamps)
    beats = np.rint((stamps - stamps[0]) * rate_hz)
    return {
        "name": f"{name}: commands",
        "asked_hz": rate_hz,
        "measured_hz": round(1e3 / float(gaps.mean()), 3),
        "seconds": round(float(stamps[-1] - stamps[0]), 1),
        "messages": len(stamps),
        # Of the schedule: messages stand at multiples of one period, whichever of them are left out.
        "schedule_hz": round(1 / float(np.polyfit(beats, stamps, 1)[0]), 4),
        "between_stalls_hz": round(1e3 / float(gaps[gaps < STALL * 1e3 / rate_hz].mean()), 3),
        "left_out": int(beats[-1]) + 1 - len(stamps),
        "interval_ms": {str(p): round(float(np.percentile(gaps, p)), 3) for p in (1, 50, 99, 100)},
        "jitter_ms_std": round(float(gaps.std()), 3),
        "moves": moves,
        "moves_that_failed": faults,
    }


def main() -> None:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=list(ARMS))
    parser.add_argument("--realtime", type=lambda text: text.lower() == "true", default=False)
    given = parser.parse_args()
    if given.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    for name in given.arms:
        load = {"realtime": given.realtime, "load_1min": round(os.getloadavg()[0], 1), "cores": os.cpu_count()}
        print(json.dumps(row(name, given.seconds) | load | {"machine": machine()}), flush=True)


if __name__ == "__main__":
    main()
