"""One frame of a replay: the scene, what the policy was given of it, and what it did."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.configs import EnvCfg
from tr_grasp.envs import Outcome
from tr_grasp.envs.picture import PICTURE_EYE_M, PICTURE_TARGET_M
from tr_grasp.envs.sensor import octree_spec
from tr_grasp.evaluation.octree_view import Gripper, OctreeView
from tr_grasp.evaluation.replay import IMAGE_PX, ReplayStep

BAND_PX = 58
BAND = (24, 30, 42)
TEXT = (226, 232, 240)
MUTED = (122, 134, 153)
GOOD = (52, 168, 104)
BAD = (240, 122, 110)
STAGES = ("reach", "touch", "grasp", "lift")


class ReplayView:
    """Draws replays of one world, both halves seen from the same side.

    Args:
        cfg: The world.
        image_px: Size of each half; that of the recorded pictures.
    """

    def __init__(self, cfg: EnvCfg, image_px: int = IMAGE_PX) -> None:
        towards = np.subtract(PICTURE_TARGET_M, PICTURE_EYE_M)
        self._octrees = OctreeView(octree_spec(cfg), towards, image_px)
        self._px = image_px

    def frames(self, steps: Sequence[ReplayStep]) -> Iterator[NDArray[np.uint8]]:
        """A ``(h, w, 3)`` frame for each instant; the last one tells the outcome."""
        for step in steps:
            yield self.frame(step, is_last=step is steps[-1])

    def frame(self, step: ReplayStep, *, is_last: bool = False) -> NDArray[np.uint8]:
        """One frame: scene left, octree right, text below."""
        canvas = Image.new("RGB", (2 * self._px, self._px + BAND_PX), BAND)
        canvas.paste(Image.fromarray(step.image), (0, 0))
        canvas.paste(Image.fromarray(self._octrees.draw(step.octree, gripper_of(step.proprio))), (self._px, 0))
        pencil = ImageDraw.Draw(canvas)
        pencil.text((10, self._px + 6), action_text(step), fill=TEXT, font=_font(16))
        _draw_stages(pencil, step, self._px + 32)
        if is_last:
            _draw_outcome(pencil, step, 2 * self._px - 10, self._px + 32)
        return np.asarray(canvas)


def gripper_of(proprio: NDArray[np.float32]) -> Gripper:
    """The gripper as the ``(10,)`` proprioception describes it."""
    return Gripper(tcp_m=proprio[1:4], closing_axis=proprio[7:10], opening=float(np.clip(proprio[0], -1, 1)))


def action_text(step: ReplayStep) -> str:
    """The step and its action in words, without units: the components are shares of the largest step."""
    if step.action is None:
        return "step 0    start"
    # Adding zero turns the -0.0 that rounding leaves into 0.0.
    x, y, z, yaw = (step.action[:4].round(2) + 0.0).tolist()
    hand = "open" if step.action[4] > 0 else "close"
    return f"step {step.step}    x {x:+.2f}   y {y:+.2f}   z {z:+.2f}   turn {yaw:+.2f}   {hand}"


def _draw_stages(pencil: ImageDraw.ImageDraw, step: ReplayStep, top: int) -> None:
    left = 10
    for name, done in zip(STAGES, step.stages, strict=True):
        width = int(_font(14).getlength(name)) + 14
        pencil.rounded_rectangle(
            (left, top, left + width, top + 19), 4, fill=GOOD if done else None, outline=GOOD if done else MUTED
        )
        pencil.text((left + 7, top + 1), name, fill=(255, 255, 255) if done else MUTED, font=_font(14))
        left += width + 6


def _draw_outcome(pencil: ImageDraw.ImageDraw, step: ReplayStep, right: int, top: int) -> None:
    colour = GOOD if step.outcome == Outcome.LIFTED.label else BAD
    pencil.text((right, top), step.outcome, fill=colour, font=_font(16), anchor="ra")


@lru_cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)
