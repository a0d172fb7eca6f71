import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.envs.contacts import Contacts

LEFT, RIGHT, UP = np.array([[0.0, 1, 0], [0, -1, 0], [0, 0, 1]])


def contacts(forces, normals) -> Contacts:
    """Of each finger on one object."""
    return Contacts(np.array(forces, float)[:, None], np.array(normals, float)[:, None], ground=False)


def test_two_fingers_that_press_against_each_other_pinch():
    assert contacts([5, 5], [LEFT, RIGHT]).pinched.tolist() == [True]
    assert contacts([5, 0.05], [LEFT, RIGHT]).pinched.tolist() == [False]
    assert contacts([5, 5], [UP, UP]).pinched.tolist() == [False]


def test_of_three_fingers_the_thumb_and_either_of_the_others_pinch():
    assert contacts([5, 0, 5], [LEFT, RIGHT, RIGHT]).pinched.tolist() == [True]
    assert contacts([5, 5, 0], [LEFT, RIGHT, RIGHT]).pinched.tolist() == [True]
    assert contacts([5, 5, 5], [LEFT, RIGHT, RIGHT]).pinched.tolist() == [True]
    assert contacts([0, 5, 5], [LEFT, LEFT, RIGHT]).pinched.tolist() == [False]
    assert contacts([5, 0, 5], [LEFT, RIGHT, LEFT]).pinched.tolist() == [False]


@given(angle=st.floats(0, np.pi), force=st.floats(0.2, 50))
def test_fingers_pinch_from_directions_more_than_45_degrees_apart(angle, force):
    if abs(angle - np.pi / 4) < 1e-6:
        return
    turned = [0.0, np.cos(angle), np.sin(angle)]
    assert contacts([force, force], [LEFT, turned]).pinched.tolist() == [angle > np.pi / 4]


def test_each_object_is_judged_by_itself():
    forces, normals = np.array([[5.0, 0], [5, 5]]), np.stack([[LEFT, LEFT], [RIGHT, RIGHT]])
    seen = Contacts(forces, normals, ground=False)
    assert seen.pinched.tolist() == [True, False]
    assert seen.touched.tolist() == [True, True]
