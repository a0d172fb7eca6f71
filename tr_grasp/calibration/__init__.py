"""Where a camera is, seen from a robot: boards, detection, collection, solving, uncertainty. No simulator, no ROS."""

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.closed_form import METHODS, Method, solve_closed_form
from tr_grasp.calibration.coverage import Coverage, coverage_of
from tr_grasp.calibration.detection import Detection, DetectionCfg, Reason, Refused, detect_board
from tr_grasp.calibration.interchange import (
    CalibrationRecord,
    load_calibration,
    read_samples,
    save_calibration,
    static_transform,
)
from tr_grasp.calibration.intrinsics import D415_COLOUR, Intrinsics
from tr_grasp.calibration.laboratory import LabCfg, Laboratory
from tr_grasp.calibration.printing import print_board
from tr_grasp.calibration.rendering import Eye, ImageNoise, RaycastEye, render_board
from tr_grasp.calibration.samples import SETUPS, Sample, Setup
from tr_grasp.calibration.session import Frames, HandEyeSession, SessionCfg
from tr_grasp.calibration.solve import HandEyeResult, solve_hand_eye
from tr_grasp.calibration.uncertainty import Uncertainty
from tr_grasp.calibration.views import View, ViewCfg

__all__ = [
    "D415_COLOUR",
    "METHODS",
    "SETUPS",
    "BoardSpec",
    "CalibrationRecord",
    "Coverage",
    "Detection",
    "DetectionCfg",
    "Eye",
    "Frames",
    "HandEyeResult",
    "HandEyeSession",
    "ImageNoise",
    "Intrinsics",
    "LabCfg",
    "Laboratory",
    "Method",
    "RaycastEye",
    "Reason",
    "Refused",
    "Sample",
    "SessionCfg",
    "Setup",
    "Uncertainty",
    "View",
    "ViewCfg",
    "coverage_of",
    "detect_board",
    "load_calibration",
    "print_board",
    "read_samples",
    "render_board",
    "save_calibration",
    "solve_closed_form",
    "solve_hand_eye",
    "static_transform",
]
