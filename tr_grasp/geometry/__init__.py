"""Rigid-body mathematics in numpy: float64, column vectors, ``T_a_b`` maps b into a."""

from tr_grasp.geometry.transforms import (
    invert_transform,
    look_at,
    matrix_from_wxyz,
    random_wxyz,
    rotate_points,
    rotation_about_z,
    transform_from,
    transform_points,
    wrap_half_turn,
    wxyz_from_matrix,
)

__all__ = [
    "invert_transform",
    "look_at",
    "matrix_from_wxyz",
    "random_wxyz",
    "rotate_points",
    "rotation_about_z",
    "transform_from",
    "transform_points",
    "wrap_half_turn",
    "wxyz_from_matrix",
]
