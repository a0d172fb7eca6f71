"""A contact sheet of random looks: the camera's picture by both backends, and a photograph.

python scripts/looks_sheet.py looks.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from tr_grasp.configs import CameraCfg, EnvCfg, ObjectsCfg, RandomisationCfg
from tr_grasp.envs import make_env
from tr_grasp.sensing import RaycastCamera

EPISODES, EDGE_PX = 5, 220
SWITCHES = ("ground_texture", "table_colour", "object_tint", "light")


def main() -> None:
    """Write the sheet; needs a Vulkan device."""
    cfg = EnvCfg(
        camera=CameraCfg(backend="sapien", image_size_px=EDGE_PX),
        objects=ObjectsCfg(count_range=(3, 4)),
        randomise=RandomisationCfg(**dict.fromkeys(SWITCHES, True)),
    )
    env = make_env(cfg, seed=0)
    columns = []
    for _ in range(EPISODES):
        env.reset()
        view = env.task.view
        cast = RaycastCamera(view.raycast, view.camera, look=view.look).capture(view.poses())
        pictures = [(255 * colour).astype(np.uint8) for colour in (cast.colour, view.capture().colour)]
        columns.append(np.concatenate([*pictures, env.task.photograph(EDGE_PX)]))
    env.close()
    Image.fromarray(np.concatenate(columns, axis=1)).save(Path(sys.argv[1] if len(sys.argv) > 1 else "looks.png"))


if __name__ == "__main__":
    main()
