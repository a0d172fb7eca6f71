from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tr_grasp.errors import MeshError
from tr_grasp.objects import FAMILIES, ObjectModel, object_set, shapes
from tr_grasp.objects.layouts import sub_folders
from tr_grasp.objects.model import distance_outside

pytestmark = pytest.mark.sim

PHYSICS_HZ = 100


@pytest.fixture
def actors():
    return pytest.importorskip("tr_grasp.objects.actors")


@pytest.fixture
def scene(actors):
    """A ManiSkill scene that can never render."""
    import sapien
    from mani_skill.envs.scene import ManiSkillScene
    from mani_skill.envs.utils.system.backend import parse_sim_and_render_backend

    backend = parse_sim_and_render_backend("physx_cpu", "none")
    system = sapien.physx.PhysxCpuSystem()
    system.timestep = 1 / PHYSICS_HZ
    scene = ManiSkillScene([sapien.Scene([system])], device=backend.device, backend=backend)
    ground = sapien.physx.PhysxRigidStaticComponent()
    ground.attach(sapien.physx.PhysxCollisionShapePlane(sapien.physx.PhysxMaterial(1.0, 1.0, 0.0)))
    entity = sapien.Entity()
    entity.add_component(ground)
    # The plane's normal is +x of its frame; turn it up.
    entity.pose = sapien.Pose([0, 0, 0], [np.sqrt(0.5), 0, -np.sqrt(0.5), 0])
    scene.sub_scenes[0].add_entity(entity)
    return scene


def box_model(size: tuple[float, float, float]) -> ObjectModel:
    part = shapes.box(size)
    return ObjectModel.assemble("brick", "box", [part], part, np.full((12, 3), 0.5))


def assert_parts_are_kept(body, model: ObjectModel) -> None:
    """PhysX rounds hulls when it prepares them; by no more than a tenth of a millimetre here."""
    for shape, part in zip(body.collision_shapes, model.parts, strict=True):
        hull = trimesh.convex.convex_hull(np.asarray(shape.vertices) * shape.scale)
        assert distance_outside(hull, np.asarray(part.vertices)).max() < 1e-4
        assert distance_outside(part, np.asarray(hull.vertices)).max() < 1e-4


def test_a_brick_weighs_what_was_asked_and_turns_like_a_uniform_one(actors):
    body = actors.rigid_body(box_model((0.1, 0.06, 0.04)), mass_kg=0.3, friction=0.8)
    assert body.mass == pytest.approx(0.3, rel=1e-6)
    # m / 12 (b^2 + c^2) about each axis; PhysX may order its principal axes otherwise.
    expected = 0.3 / 12 * np.array([0.06**2 + 0.04**2, 0.1**2 + 0.04**2, 0.1**2 + 0.06**2])
    np.testing.assert_allclose(np.sort(body.inertia), np.sort(expected), rtol=1e-4)
    np.testing.assert_allclose(body.cmass_local_pose.p, 0, atol=1e-6)
    (shape,) = body.collision_shapes
    assert shape.get_collision_groups() == [1, 1, 0, 0]
    assert shape.physical_material.static_friction == pytest.approx(0.8)
    assert shape.physical_material.restitution == 0


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_physics_takes_every_part_as_it_is(actors, name):
    model = FAMILIES[name].sample("test", np.random.default_rng(0))
    body = actors.rigid_body(model, mass_kg=0.1, friction=1.0)
    assert_parts_are_kept(body, model)
    inertia = sum(np.asarray(part.moment_inertia_frame(np.eye(4))) for part in model.parts)
    expected = np.linalg.eigvalsh(inertia) * 0.1 / model.volume_m3
    np.testing.assert_allclose(np.sort(body.inertia), expected, rtol=1e-3)
    np.testing.assert_allclose(body.cmass_local_pose.p, 0, atol=1e-5)


def test_dropped_objects_of_every_family_come_to_rest_on_the_plane(actors, scene):
    import sapien

    rng = np.random.default_rng(1)
    models = {name: FAMILIES[name].sample("test", rng) for name in FAMILIES}
    objects = {}
    for index, (name, model) in enumerate(models.items()):
        quaternion = rng.normal(size=4)
        pose = sapien.Pose([0.4 * (index % 5), 0.4 * (index // 5), 0.13], quaternion / np.linalg.norm(quaternion))
        objects[name] = actors.add_object(scene, model, name, mass_kg=0.1, friction=1.0, pose=pose)
    for _ in range(8 * PHYSICS_HZ):
        scene.step()
    for name, actor in objects.items():
        rotation = actor.pose.to_transformation_matrix()[0, :3, :3].numpy()
        height = actor.pose.p[0, 2].item()
        corners = np.concatenate([part.vertices for part in models[name].parts]) @ rotation.T
        assert abs(corners[:, 2].min() + height) < 0.002, name
        assert actor.linear_velocity.norm() < 0.02, name
        assert actor.get_state().isfinite().all(), name


def test_an_added_object_is_registered_in_the_scene_and_its_state(actors, scene):
    import sapien

    pose = sapien.Pose([0.1, 0.2, 0.3])
    actor = actors.add_object(scene, box_model((0.1, 0.06, 0.04)), "brick", mass_kg=0.3, friction=0.8, pose=pose)
    assert scene.actors["brick"] is actor
    assert actor.name == "brick"
    assert actor.px_body_type == "dynamic"
    np.testing.assert_allclose(actor.pose.p[0], [0.1, 0.2, 0.3], atol=1e-6)
    np.testing.assert_allclose(actor.initial_pose.p[0], [0.1, 0.2, 0.3], atol=1e-6)
    np.testing.assert_allclose(scene.get_sim_state()["actors"]["brick"][0, :3], [0.1, 0.2, 0.3], atol=1e-6)
    with pytest.raises(ValueError, match="name must be unused in the scene, got 'brick'"):
        actors.add_object(scene, box_model((0.1, 0.06, 0.04)), "brick", mass_kg=0.3, friction=0.8)


def test_adding_an_object_needs_no_graphics_driver():
    code = (
        "import numpy as np, sapien, sapien.physx as physx\n"
        "from tr_grasp.objects import FAMILIES\n"
        "from tr_grasp.objects.actors import rigid_body\n"
        "scene = sapien.Scene([physx.PhysxCpuSystem()])\n"
        "entity = sapien.Entity()\n"
        "mug = FAMILIES['mug'].sample('test', np.random.default_rng(0))\n"
        "entity.add_component(rigid_body(mug, mass_kg=1, friction=1))\n"
        "scene.add_entity(entity); scene.step()\n"
    )
    environment = os.environ | {"VK_DRIVER_FILES": "/nonexistent"}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True)


@pytest.mark.parametrize(
    ("mass_kg", "friction", "message"),
    [(0.0, 1.0, "mass_kg"), (float("nan"), 1.0, "mass_kg"), (1.0, -0.1, "friction"), (1.0, float("nan"), "friction")],
)
def test_masses_and_frictions_that_make_no_sense_are_refused(actors, mass_kg, friction, message):
    with pytest.raises(ValueError, match=message):
        actors.rigid_body(box_model((0.1, 0.1, 0.1)), mass_kg=mass_kg, friction=friction)


def test_a_part_that_physics_refuses_is_named(actors):
    broken = shapes.box((0.1, 0.1, 0.1))
    broken.vertices[0, 0] = np.nan
    model = ObjectModel("broken", "box", (broken,), broken, np.zeros((12, 3), np.float32))
    with pytest.raises(MeshError, match="PhysX cannot use a part of object 'broken'"):
        actors.rigid_body(model, mass_kg=0.1, friction=1.0)


def test_physics_turns_an_object_of_another_size_as_uniform_density_asks(actors):
    model = FAMILIES["hammer"].sample("train", np.random.default_rng(0)).scaled(1.3)
    body = actors.rigid_body(model, mass_kg=0.2, friction=1.0)
    expected = np.linalg.eigvalsh(model.inertia_kgm2(0.2))
    np.testing.assert_allclose(np.sort(body.inertia), expected, rtol=1e-3)


def users_sets() -> list[str]:
    root = os.environ.get("TR_GRASP_OBJECTS")
    return [path.name for path in sub_folders(Path(root))] if root else []


@pytest.mark.parametrize("split", ["train", "test"])
@pytest.mark.parametrize("name", users_sets())
def test_every_object_of_the_users_sets_can_be_simulated(actors, name, split):
    objects = object_set(name, split, overlap="leave_out")
    rng = np.random.default_rng(0)
    for _ in range(2 * len(objects.names)):
        model = objects.sample(rng)
        body = actors.rigid_body(model, mass_kg=0.1, friction=1.0)
        assert_parts_are_kept(body, model)
        np.testing.assert_allclose(body.cmass_local_pose.p, 0, atol=1e-4)
