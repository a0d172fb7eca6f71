"""The present instant of a Task I environment as a station of the hardware protocols."""

from __future__ import annotations

import numpy as np

from tr_grasp.envs.robot_bodies import TABLE_COLOUR
from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.envs.things import Thing
from tr_grasp.envs.torchrl_env import TorchRLGraspEnv
from tr_grasp.geometry import transform_from

TABLE_M = (2.0, 2.0, 0.1)


def station_of(env: TorchRLGraspEnv) -> SapienStation:
    """A station with the same robot, objects, camera and table, and all of them where they are now.

    Objects have their mass and friction and lie as they lie; the arm stands still at its joints, fingers open.

    Args:
        env: After a reset.
    """
    task = env.task
    top = transform_from(np.eye(3), (0.0, 0.0, -TABLE_M[2] / 2))
    things = [Thing("table", top, size_m=TABLE_M, colour=TABLE_COLOUR)]
    bodies = [entity.find_component_by_type(_body_class()) for entity in task._entities]
    for i, (model, body) in enumerate(zip(task.models, bodies, strict=True)):
        friction = body.collision_shapes[0].physical_material.static_friction
        T = body.entity.pose.to_transformation_matrix().astype(float)
        things.append(Thing(f"object_{i}", T, model=model, mass_kg=float(body.mass), friction=float(friction)))
    station = SapienStation.of(task._robot_uid, things=things, camera=task.view.camera, physics_hz=task.cfg.physics_hz)
    for i in range(len(bodies)):
        placed = station.world.entities[f"object_{i}"].find_component_by_type(_body_class())
        placed.angular_damping = 1.0  # as in the environment: PhysX has no rolling friction
    arm = task.controller
    station.arm.place(np.asarray(task.agent.robot._objs[0].qpos, float)[arm._arm_index])
    return station


def object_heights(station: SapienStation) -> np.ndarray:
    """(objects,) heights of the objects' centres of mass [m]."""
    names = [name for name in station.world.things if name.startswith("object_")]
    return np.array([station.world.true_pose(name)[2, 3] for name in names])


def _body_class():
    from sapien import physx

    return physx.PhysxRigidDynamicComponent
