"""Environment steps per second by robot, by randomiser and by contact iterations; how far stereo depth is off.

    python -m benchmarks.randomisers [switches | robots | contacts | depth]

Prints one JSON row a measurement. The environments of a comparison take turns, step by step, with the same seeds and
actions, and time is that of one core (process time), so that another load on the machine falls on all alike.
``cost`` is the share by which 100 steps and their reset take longer than the peer's; a negative one is noise or, for
the count of objects, an easier scene.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from statistics import median
from typing import Any, TypeVar

import numpy as np
import torch

from benchmarks._common import print_row
from tr_grasp import keys
from tr_grasp.configs import EnvCfg, ObjectsCfg, RandomisationCfg
from tr_grasp.envs import make_env
from tr_grasp.sensing import DepthImage, PinholeCamera
from tr_grasp.sensing.stereo import depth_error_m, with_stereo_errors

EPISODES, STEPS, EPISODE_STEPS = 8, 20, 100
ROBOTS = ("panda", "ur5_rg2", "ur5_robotiq_2f85", "j2s7s300")
CONTACT_ITERATIONS = (15, 40)
OBJECTS = ObjectsCfg(count_range=(2, 4))
Label = TypeVar("Label")


@dataclass
class Times:
    """Milliseconds of every step and every reset of one environment."""

    steps: list[float] = field(default_factory=list)
    resets: list[float] = field(default_factory=list)

    @property
    def episode_ms(self) -> float:
        """A reset and 100 steps."""
        return median(self.resets) + EPISODE_STEPS * median(self.steps)


def none_on() -> RandomisationCfg:
    """Every randomiser off."""
    return RandomisationCfg(**{name: values[0] for name, values in switch_values().items()})


def all_on() -> RandomisationCfg:
    """Every randomiser on, depth noise of the stereo camera."""
    return RandomisationCfg(**{name: values[-1] for name, values in switch_values().items()})


def switch_values() -> dict[str, tuple[Any, ...]]:
    """Of each switch, off and its ways to be on."""
    values: dict[str, tuple[Any, ...]] = {each.name: (False, True) for each in fields(RandomisationCfg)}
    return values | {"depth_noise": ("none", "gaussian", "stereo")}


def each_alone() -> dict[str, EnvCfg]:
    """The task without any randomiser, and with each one; three objects on average."""
    task = EnvCfg(objects=OBJECTS, randomise=none_on())
    three = replace(task, objects=replace(OBJECTS, count_range=(3, 3)))
    found = {"none": three}
    for name, (_, *ways) in switch_values().items():
        for way in ways:
            base = task if name == "object_count" else three
            label = name if way is True else f"{name} {way}"
            found[label] = replace(base, randomise=replace(base.randomise, **{name: way}))
    return found | {"all": replace(task, randomise=all_on())}


def measure(cfgs: Mapping[Label, EnvCfg]) -> dict[Label, Times]:
    """Step all environments in turn."""
    envs = {name: make_env(cfg, seed=0) for name, cfg in cfgs.items()}
    times = {name: Times() for name in cfgs}
    actions = torch.Generator().manual_seed(0)
    for _ in range(EPISODES):
        now = {name: timed(env.reset, times[name].resets) for name, env in envs.items()}
        for _ in range(STEPS):
            action = 2 * torch.rand(5, generator=actions) - 1
            for name, env in envs.items():
                step = now[name].set(keys.ACTION, action)
                now[name] = timed(lambda env=env, step=step: env.step(step), times[name].steps)["next"]
                now[name] = now[name].select(*env.observation_spec.keys())
    for env in envs.values():
        env.close()
    return times


def timed(call: Callable[[], Any], into: list[float]) -> Any:
    """The call's result; its milliseconds of this core go into a list."""
    start = time.process_time()
    result = call()
    into.append(1e3 * (time.process_time() - start))
    return result


def print_times(name: str, times: Times, peer: str, against: Times) -> None:
    """One row."""
    step, reset = median(times.steps), median(times.resets)
    cost = times.episode_ms / against.episode_ms - 1.0
    rate = 1e3 * EPISODE_STEPS / times.episode_ms
    more = {"reset_ms": round(reset, 1), "steps_per_s": round(rate, 1), "cost": round(cost, 3)}
    print_row(name, step, peer, median(against.steps), **more)


def print_depth_errors() -> None:
    """Errors of the stereo camera on a wall that it faces, against the D415's datasheet and Intel's formula."""
    camera = PinholeCamera.looking_at((1.0, 0.0, 0.6), (0.5, 0.0, 0.0), 0.47, 400)
    colour = np.zeros((400, 400, 3), np.float32)
    for depth_m in (0.5, 1.0, 2.0):
        wall = DepthImage(np.full((400, 400), depth_m, np.float32), colour)
        errors = with_stereo_errors(wall, camera, np.random.default_rng(0)).depth - np.float32(depth_m)
        row = {
            "name": f"stereo depth at {depth_m:g} m",
            "rms_mm": round(1e3 * float(np.sqrt((errors**2).mean())), 2),
            "intel_formula_mm": round(1e3 * float(depth_error_m(depth_m)), 2),
            "share_of_depth": round(float(np.sqrt((errors**2).mean())) / depth_m, 5),
            "datasheet_share": 0.02,
            "pixels_within_datasheet": round(float((np.abs(errors) <= 0.02 * depth_m).mean()), 5),
        }
        print(json.dumps(row), flush=True)


def print_switches() -> None:
    """Each randomiser against none."""
    by_switch = measure(each_alone())
    for name, times in by_switch.items():
        print_times(f"randomiser {name}", times, "randomiser none", by_switch["none"])


def print_robots() -> None:
    """Each robot against the Panda, the task as it is by default."""
    by_robot = measure({robot: EnvCfg(robot=robot) for robot in ROBOTS})
    for robot, times in by_robot.items():
        print_times(f"robot {robot}", times, "robot panda", by_robot["panda"])


def print_contacts() -> None:
    """40 contact iterations, as by default, against the 15 of the shipped policies."""
    by_iterations = measure({count: EnvCfg(contact_iterations=count) for count in CONTACT_ITERATIONS})
    few = by_iterations[CONTACT_ITERATIONS[0]]
    for count, times in by_iterations.items():
        print_times(f"contact iterations {count}", times, f"contact iterations {CONTACT_ITERATIONS[0]}", few)


def main(which: str = "") -> None:
    """Run all parts, or the one that is named."""
    torch.set_num_threads(1)
    parts = {
        "depth": print_depth_errors,
        "switches": print_switches,
        "robots": print_robots,
        "contacts": print_contacts,
    }
    for run in [parts[which]] if which else parts.values():
        run()


if __name__ == "__main__":
    main(*sys.argv[1:2])
