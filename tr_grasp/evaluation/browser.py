"""A scene in the browser: robot, objects, camera, point cloud and octree, live and with a slider to go back."""

from __future__ import annotations

import io
import time
from contextlib import redirect_stdout
from typing import TYPE_CHECKING, cast

import numpy as np
import trimesh
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

from tr_grasp.envs import GraspNovelObjectsEnv
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.browser_shapes import Snapshot, body_mesh, ground_mesh, snapshot
from tr_grasp.geometry import wxyz_from_matrix

if TYPE_CHECKING:
    import viser

Array = NDArray[np.floating]
EYE_M, TARGET_M = (1.25, -0.85, 0.75), (0.42, 0.08, 0.1)
OCTREE_BESIDE_M = np.array([0.0, 0.4, 0.0])
"""Where the octree is shown, from where it is: in its own place it would hide the objects."""
LEAF_SHARE = 0.92
WIRE = (90, 110, 140)
SKY = 0.25
"""Light from everywhere, as a share of what viser gives."""


class BrowserView:
    """Serves a page with the scene; to be called with every instant of an episode (see ``rollouts.Watch``).

    Args:
        port: Where to serve; the next free one if it is taken.
        step_s: How long every step is shown while it is played.

    Raises:
        ConfigError: The package viser is not installed.
    """

    def __init__(self, port: int = 8080, step_s: float = 0.25) -> None:
        try:
            import viser
        except ImportError as error:
            raise ConfigError("--browser needs the package viser: pip install 'tr-grasp[viewer]'.") from error
        with redirect_stdout(io.StringIO()):  # it announces itself in spite of verbose
            self.server = viser.ViserServer(host="127.0.0.1", port=port, label="tr_grasp", verbose=False)
        self.snapshots: list[Snapshot] = []
        self._step_s = step_s
        self._bodies: list[viser.SceneNodeHandle] = []
        self._prepare_page()

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://localhost:{self.server.get_port()}"

    def __call__(self, env: EnvBase, step: int, action: Tensor | None, state: TensorDictBase) -> None:
        """Show one instant; the first of an episode brings a new scene."""
        task = cast("GraspNovelObjectsEnv", env.task)
        if step == 0:
            self.snapshots = []
            self._new_scene(task)
        self.snapshots.append(snapshot(task, step, state))
        self._slider.max = max(1, step)
        self._slider.value = step
        self.show(step)
        time.sleep(self._step_s)

    def show(self, step: int) -> None:
        """Show an instant of the present episode again."""
        now, scene = self.snapshots[step], self.server.scene
        with self.server.atomic():
            for handle, pose in zip(self._bodies, now.poses, strict=True):
                handle.position, handle.wxyz = pose[:3, 3], wxyz_from_matrix(pose[:3, :3])
            scene.add_point_cloud(
                "/points", now.points, now.point_colours, point_size=0.003, visible=self._show_points.value
            )
            self._draw_leaves(now)
            self._frustum.image = now.image
            self._text.content = now.text

    def close(self) -> None:
        """Take the page away."""
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    def _prepare_page(self) -> None:
        server = self.server
        server.scene.set_up_direction("+z")
        server.initial_camera.position, server.initial_camera.look_at = EYE_M, TARGET_M
        server.gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        self._text = server.gui.add_markdown("")
        self._slider = server.gui.add_slider("step", min=0, max=1, step=1, initial_value=0)
        self._show_points = server.gui.add_checkbox("points", True)
        self._show_octree = server.gui.add_checkbox("octree", True)
        for control in (self._slider, self._show_points, self._show_octree):
            control.on_update(lambda event: self._go_back() if event.client is not None else None)

    def _go_back(self) -> None:
        # While the slider is moved, the episode may have been replaced by a shorter one.
        if self.snapshots:
            self.show(min(int(self._slider.value), len(self.snapshots) - 1))

    def _new_scene(self, task: GraspNovelObjectsEnv) -> None:
        scene, view, spec = self.server.scene, task.view, task.sensor.spec
        scene.reset()
        scene.configure_default_lights(cast_shadow=True)
        # At its full strength the sky washes the colours out: a brown table looks white.
        scene.configure_environment_map(environment_intensity=SKY)
        scene.add_mesh_trimesh("/table", ground_mesh(view.look.ground), cast_shadow=False)
        objects = view.object_indices
        names = [f"/objects/{i - objects.start}" if i in objects else f"/robot/{i}" for i in range(len(view.bodies))]
        self._bodies = [
            scene.add_mesh_trimesh(name, body_mesh(body)) for name, body in zip(names, view.bodies, strict=True)
        ]
        for name, offset in (("workspace", np.zeros(3)), ("octree", OCTREE_BESIDE_M)):
            centre = np.array(spec.centre_m) + offset
            scene.add_box(f"/{name}", WIRE, (spec.side_m,) * 3, wireframe=True, position=centre, cast_shadow=False)
        self._leaf = trimesh.creation.box([LEAF_SHARE * spec.leaf_m] * 3)
        camera = view.camera
        self._frustum = scene.add_camera_frustum(
            "/camera",
            camera.fov_rad,
            camera.width_px / camera.height_px,
            scale=0.06,
            thickness=0.0015,
            cast_shadow=False,
            position=camera.T_base_cam[:3, 3],
            wxyz=wxyz_from_matrix(camera.T_base_cam[:3, :3]),
        )

    def _draw_leaves(self, now: Snapshot) -> None:
        upright = np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (len(now.leaves), 1))
        self.server.scene.add_batched_meshes_simple(
            "/leaves",
            np.asarray(self._leaf.vertices, np.float32),
            np.asarray(self._leaf.faces, np.uint32),
            batched_wxyzs=upright,
            batched_positions=now.leaves,
            batched_colors=now.leaf_colours,
            flat_shading=True,
            position=OCTREE_BESIDE_M,
            visible=self._show_octree.value,
        )
