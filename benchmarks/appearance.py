"""What looks cost: the camera and a reset with and without them, turn by turn in one run.

    python -m benchmarks.appearance

Prints one JSON row a measurement; ``ratio`` is how many times faster than with everything off.
"""

from __future__ import annotations

import numpy as np
import torch

from benchmarks._common import median_ms, print_row
from tr_grasp.configs import EnvCfg, ObjectsCfg, RandomisationCfg
from tr_grasp.envs import make_env
from tr_grasp.envs.appearance import draw_look
from tr_grasp.sensing import RaycastCamera
from tr_grasp.sensing.look import Look
from tr_grasp.sensing.textures import FAMILIES, draw_recipe, texture_image

SWITCHES = ("ground_texture", "table_colour", "light")
SEED = 3


def main() -> None:
    """Run all measurements."""
    torch.set_num_threads(1)
    cfg = EnvCfg(objects=ObjectsCfg(count_range=(4, 4)))
    env = make_env(cfg, seed=0)
    env.reset()
    view = env.task.view
    looks = {"everything off": Look()}
    for switches in [*((name,) for name in SWITCHES), SWITCHES]:
        randomise = RandomisationCfg(**dict.fromkeys(switches, True))
        looks[" + ".join(switches)] = draw_look(EnvCfg(randomise=randomise), SEED)
    wanted = view._raycast_camera._wanted
    cameras = {name: RaycastCamera(view.raycast, view.camera, wanted, look) for name, look in looks.items()}
    poses = view.poses()
    off, *others = median_ms(*(lambda camera=camera: camera.capture(poses) for camera in cameras.values()), repeats=200)
    for name, ms in zip(cameras, [off, *others], strict=True):
        print_row(f"picture 80 x 80, {name}", ms, "picture, everything off", off)
    made = [lambda look=look: RaycastCamera(view.raycast, view.camera, wanted, look) for look in looks.values()]
    for name, ms in zip(looks, median_ms(*made, repeats=40), strict=True):
        print_row(f"once an episode: the camera's ground, {name}", ms)
    recipes = [
        draw_recipe(split, np.random.default_rng(SEED), family) for split, all_ in FAMILIES.items() for family in all_
    ]
    texture_ms = median_ms(*(lambda recipe=recipe: texture_image(recipe) for recipe in recipes))
    print_row("once an episode: a texture, mean of all families", float(np.mean(texture_ms)))
    env.close()


if __name__ == "__main__":
    main()
