"""Objects as ManiSkill actors, straight from arrays; the only file here that knows the simulator."""

from __future__ import annotations

import numpy as np
import sapien
import sapien.physx as physx
import torch
from mani_skill.envs.scene import ManiSkillScene
from mani_skill.utils.structs.actor import Actor
from mani_skill.utils.structs.pose import Pose

from tr_grasp.errors import MeshError
from tr_grasp.objects.model import ObjectModel

COLLISION_GROUPS = [1, 1, 0, 0]

COOKING_SCALE = 100.0
"""PhysX rounds 0.7 mm off any hull that it prepares, so it is given large ones and told to shrink them."""


def add_object(
    scene: ManiSkillScene,
    model: ObjectModel,
    name: str,
    *,
    mass_kg: float,
    friction: float,
    pose: sapien.Pose | None = None,
) -> Actor:
    """Put an object into the (only) sub-scene and register it as ``scene.actors[name]``.

    Physics needs no graphics driver; the visual mesh is added only where the scene can render.

    Args:
        scene: A scene with a single sub-scene.
        model: What to add.
        name: A name that no actor of the scene has.
        mass_kg: Mass of the whole object; inertia is that of uniform density.
        friction: Static and dynamic friction coefficient.
        pose: First pose of the object frame in the scene; the scene's origin if left out.

    Raises:
        ValueError: If the mass is not positive, friction is negative, or the name is taken.
        MeshError: If the physics engine refuses a part.
    """
    if name in scene.actors:
        raise ValueError(f"name must be unused in the scene, got {name!r}")
    entity = sapien.Entity()
    entity.name = f"scene-0_{name}"
    entity.add_component(rigid_body(model, mass_kg=mass_kg, friction=friction))
    if scene.can_render():
        entity.add_component(_render_body(model))
    entity.pose = pose if pose is not None else sapien.Pose()
    scene.sub_scenes[0].add_entity(entity)
    actor = Actor.create_from_entities([entity], scene, torch.zeros(1, dtype=torch.int), shared_name=name)
    actor.initial_pose = Pose.create(entity.pose)
    scene.actors[name] = actor
    scene.add_to_state_dict_registry(actor)
    return actor


def rigid_body(model: ObjectModel, *, mass_kg: float, friction: float) -> physx.PhysxRigidDynamicComponent:
    """The physics of an object, for ``add_object`` or a plain SAPIEN scene; see there."""
    if not (np.isfinite(mass_kg) and mass_kg > 0):
        raise ValueError(f"mass_kg must be positive, got {mass_kg}")
    if not (np.isfinite(friction) and friction >= 0):
        raise ValueError(f"friction must not be negative, got {friction}")
    material = physx.PhysxMaterial(friction, friction, 0.0)
    body = physx.PhysxRigidDynamicComponent()
    for part in model.parts:
        vertices = np.asarray(COOKING_SCALE * part.vertices, dtype=np.float32)
        try:
            shape = physx.PhysxCollisionShapeConvexMesh(vertices, (1 / COOKING_SCALE,) * 3, material)
        except RuntimeError as error:
            raise MeshError(f"PhysX cannot use a part of object {model.name!r} ({error}); make it thicker.") from error
        shape.set_density(mass_kg / model.volume_m3)
        shape.set_collision_groups(COLLISION_GROUPS)
        body.attach(shape)
    _set_exact_mass(body, mass_kg)
    return body


def _set_exact_mass(body: physx.PhysxRigidDynamicComponent, mass_kg: float) -> None:
    # Cooked hulls differ a little from ours; setting the mass alone would leave the inertia behind.
    inertia = [float(value) * mass_kg / body.mass for value in body.inertia]
    cmass_local_pose = body.cmass_local_pose
    body.mass = mass_kg
    body.cmass_local_pose = cmass_local_pose
    body.set_inertia(inertia)


def _render_body(model: ObjectModel) -> sapien.render.RenderBodyComponent:
    """Faces keep their own vertices and look up their colour in a texture of one pixel a face."""
    corners = np.asarray(model.visual.triangles, dtype=np.float32).reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    normals = np.repeat(np.asarray(model.visual.face_normals, dtype=np.float32), 3, axis=0)
    texture, uvs = _colour_texture(model.face_colours)
    material = sapien.render.RenderMaterial(roughness=0.9, specular=0.1)
    material.base_color_texture = texture
    body = sapien.render.RenderBodyComponent()
    body.attach(sapien.render.RenderShapeTriangleMesh(corners, faces, normals, uvs, material))
    return body


def _colour_texture(face_colours: np.ndarray) -> tuple[sapien.render.RenderTexture2D, np.ndarray]:
    """A square texture of the colours in reading order, and ``(3 faces, 2)`` coordinates of their pixels."""
    faces_n = len(face_colours)
    side = int(np.ceil(np.sqrt(faces_n)))
    pixels = np.full((side * side, 4), 255, dtype=np.uint8)
    pixels[:faces_n, :3] = np.round(face_colours * 255)
    rows, columns = np.divmod(np.arange(faces_n), side)
    uvs = (np.column_stack([columns, rows]) + 0.5) / side
    image = pixels.reshape(side, side, 4)
    texture = sapien.render.RenderTexture2D(image, "R8G8B8A8Unorm", filter_mode="nearest", srgb=True)
    return texture, np.repeat(uvs, 3, axis=0).astype(np.float32)
