from __future__ import annotations

import numpy as np
import pytest

from tr_grasp.objects import ObjectModel, shapes

pytestmark = [pytest.mark.sim, pytest.mark.render]


def two_coloured_box() -> ObjectModel:
    """Red towards -y, green towards +y, seen from above."""
    parts = [shapes.box((0.1, 0.05, 0.05), (0.0, y, 0.0)) for y in (-0.025, 0.025)]
    visual_vertices = np.concatenate([part.vertices for part in parts])
    visual = type(parts[0])(visual_vertices, np.concatenate([parts[0].faces, parts[1].faces + 8]), process=False)
    colours = np.repeat([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)], 12, axis=0)
    return ObjectModel.assemble("flag", "box", parts, visual, colours)


def test_a_camera_sees_every_face_in_its_colour_and_place():
    import sapien
    from mani_skill.envs.scene import ManiSkillScene
    from mani_skill.envs.utils.system.backend import parse_sim_and_render_backend

    from tr_grasp.objects.actors import add_object

    backend = parse_sim_and_render_backend("physx_cpu", "cpu")
    systems = [sapien.physx.PhysxCpuSystem(), sapien.render.RenderSystem(backend.render_device)]
    scene = ManiSkillScene([sapien.Scene(systems)], device=backend.device, backend=backend)
    raw = scene.sub_scenes[0]
    raw.set_ambient_light([1.0, 1.0, 1.0])
    add_object(scene, two_coloured_box(), "flag", mass_kg=0.1, friction=1.0)
    camera = raw.add_camera("above", 64, 64, 0.5, 0.01, 2.0)
    # Looking down from half a metre, with +y of the world to the left of the picture.
    camera.entity.set_pose(sapien.Pose([0, 0, 0.5], [np.sqrt(0.5), 0, np.sqrt(0.5), 0]))
    raw.update_render()
    camera.take_picture()
    picture = camera.get_picture("Color")[..., :3]
    left, right = picture[32, 28], picture[32, 36]
    assert left[1] > 3 * left[0]
    assert right[0] > 3 * right[1]
    height = 0.5 + camera.get_picture("Position")[32, 32, 2]
    assert height == pytest.approx(0.025, abs=2e-3)
