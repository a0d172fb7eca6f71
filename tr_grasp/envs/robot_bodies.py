"""What cameras see of the robot and the table."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import trimesh
from sapien import physx

from tr_grasp.robots.agents import CartesianArm, CartesianPanda
from tr_grasp.robots.bodies import robot_bodies
from tr_grasp.sensing import Body

ARM_COLOUR = (0.93, 0.93, 0.95)
FINGER_COLOUR = (0.18, 0.18, 0.20)
TABLE_COLOUR = (0.48, 0.44, 0.40)
Link = physx.PhysxArticulationLinkComponent


def link_bodies(agent: CartesianPanda | CartesianArm, links: Mapping[str, Link]) -> dict[str, Body]:
    """What each link that has a shape looks like, by name; the Panda is drawn lightly, as it collides.

    Args:
        agent: The robot.
        links: Its links, by name.
    """
    if isinstance(agent, CartesianArm):
        bodies = robot_bodies(agent.spec)
        return {name: bodies[name] for name in links if name in bodies}
    return collision_bodies(links, agent.finger_links)


def collision_bodies(links: Mapping[str, Link], fingers: Collection[str]) -> dict[str, Body]:
    """The collision shapes of each link that has any, as one mesh in the link's frame."""
    return {
        name: _collision_body(link, FINGER_COLOUR if name in fingers else ARM_COLOUR)
        for name, link in links.items()
        if link.collision_shapes
    }


def _collision_body(link: Link, colour: tuple[float, float, float]) -> Body:
    mesh = trimesh.util.concatenate([_mesh(shape) for shape in link.collision_shapes])
    return Body.uniform(mesh.vertices, mesh.faces, colour)


def table_body(half_side_m: float = 1.0) -> Body:
    """A square of the table's plane z = 0 around the base frame's origin."""
    corners = half_side_m * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    return Body.uniform(corners, [[0, 1, 2], [0, 2, 3]], TABLE_COLOUR)


def _mesh(shape: physx.PhysxCollisionShape) -> trimesh.Trimesh:
    if isinstance(shape, physx.PhysxCollisionShapeBox):
        mesh = trimesh.creation.box(2 * np.asarray(shape.half_size))
    elif isinstance(shape, physx.PhysxCollisionShapeSphere):
        mesh = trimesh.creation.icosphere(2, shape.radius)
    elif isinstance(shape, (physx.PhysxCollisionShapeCapsule, physx.PhysxCollisionShapeCylinder)):
        make = (
            trimesh.creation.capsule
            if isinstance(shape, physx.PhysxCollisionShapeCapsule)
            else trimesh.creation.cylinder
        )
        mesh = make(height=2 * shape.half_length, radius=shape.radius)
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))  # along x, as PhysX has it
    else:
        mesh = trimesh.Trimesh(shape.vertices * shape.scale, shape.triangles, process=False)
    mesh.apply_transform(shape.local_pose.to_transformation_matrix())
    return mesh
