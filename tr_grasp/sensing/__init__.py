"""From simulator or camera to points with normals and colours in the robot's base frame."""

from tr_grasp.sensing.camera import DepthImage, PinholeCamera
from tr_grasp.sensing.point_cloud import PointCloud, point_cloud_from_image
from tr_grasp.sensing.raycast import Body, RaycastScene
from tr_grasp.sensing.raycast_camera import RaycastCamera

__all__ = [
    "Body",
    "DepthImage",
    "PinholeCamera",
    "PointCloud",
    "RaycastCamera",
    "RaycastScene",
    "point_cloud_from_image",
]
