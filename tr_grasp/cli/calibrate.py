"""``tr-grasp calibrate``: where a camera is, seen from a robot."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import imageio.v3 as imageio
import numpy as np

from tr_grasp.calibration.detection import Refused
from tr_grasp.calibration.interchange import read_samples, record_of, save_calibration, static_transform
from tr_grasp.calibration.laboratory import LabCfg, Laboratory
from tr_grasp.calibration.printing import print_board
from tr_grasp.calibration.rendering import Eye
from tr_grasp.calibration.rigid import Array, angle_rad, distance_m
from tr_grasp.calibration.samples import SETUPS, Setup
from tr_grasp.calibration.session import HandEyeSession, SessionCfg
from tr_grasp.calibration.solve import HandEyeResult
from tr_grasp.cli.calibrate_flags import AddCfg, BoardCfg, ImportCfg, NewCfg, SimulateCfg, SolveCfg, StatusCfg
from tr_grasp.cli.vulkan import require_vulkan
from tr_grasp.configs.io import parse
from tr_grasp.errors import CalibrationError, unknown_name
from tr_grasp.evaluation.calibration_report import calibration_html
from tr_grasp.files import write_atomically
from tr_grasp.geometry import look_at, matrix_from_wxyz, transform_from, wxyz_from_matrix
from tr_grasp.motion import Kinematics
from tr_grasp.provenance import provenance
from tr_grasp.robots import robot_spec

CALIBRATION, REPORT = "calibration.yaml", "report.html"
HELP = """usage: tr-grasp calibrate WHAT ... (tr-grasp calibrate WHAT --help lists the flags)

  board     print a board at its true size: PDF or PNG
  simulate  calibrate in a simulated laboratory, and compare with the truth
  new       start a session: a folder that keeps every sample
  add       add a picture and the robot's pose to a session
  status    what was moved so far, what is missing, and where to go next
  solve     calibrate from a session
  report    write the session's HTML report
  import    make a session of samples of MoveIt Calibration or easy_handeye"""


def main(args: list[str]) -> int:
    """Run the verb."""
    what, *rest = args or ["--help"]
    if what in ("-h", "--help", "help"):
        print(HELP)
        return 0
    if what not in WORDS:
        raise CalibrationError(unknown_name("part of calibrate", what, WORDS))
    return WORDS[what](rest)


def board(args: list[str]) -> int:
    """Print a board."""
    cfg = parse(BoardCfg, args, prog="tr-grasp calibrate board")
    print(f"{cfg.board.words}: {print_board(cfg.board, cfg.out, paper=cfg.paper, dpi=cfg.dpi)}")
    print("Print it at 100 %, check the line of 100 mm, measure a marker, glue the page on something flat and stiff.")
    return 0


def simulate(args: list[str]) -> int:
    """Collect, solve, compare with the truth."""
    cfg = parse(SimulateCfg, args, prog="tr-grasp calibrate simulate")
    lab = Laboratory(cfg.lab, sapien_eye(cfg.lab) if cfg.pictures == "sapien" else None)
    folder = cfg.out or Path("runs/calibration") / f"{cfg.lab.setup}_seed{cfg.lab.seed}"
    session = HandEyeSession.create(folder, SessionCfg(cfg.lab.setup, cfg.lab.board, lab.told_camera))
    for shot in lab.shoot_all(lab.choose_views(cfg.samples)):
        sample = session.add(shot.picture, shot.T_base_tcp, q_rad=shot.q_rad)
        if isinstance(sample, Refused):
            print(f"a picture was not taken: {sample.sentence}")
        else:
            wrong = ", wrong on purpose" if shot.is_wrong else ""
            print(f"sample {sample.name}: corners to {sample.reprojection_px:.2f} px{wrong}")
    result = session.solve(cfg.method)
    _finish(session, result, "simulate", args, truth=lab.X)
    return 0


def sapien_eye(cfg: LabCfg) -> Eye:
    """SAPIEN's renderer.

    Raises:
        ConfigError: There is no Vulkan device.
    """
    require_vulkan("--pictures sapien", "--pictures raycast")
    from tr_grasp.envs.laboratory_eye import SapienEye

    return SapienEye(cfg.robot, cfg.board)


def new(args: list[str]) -> int:
    """Start a session."""
    cfg = parse(NewCfg, args, prog="tr-grasp calibrate new")
    HandEyeSession.create(cfg.folder, cfg.session)
    print(f"{cfg.folder}: {cfg.session.setup}, {cfg.session.board.words}")
    return 0


def add(args: list[str]) -> int:
    """Add a sample; 1 if the picture was not taken."""
    cfg = parse(AddCfg, args, prog="tr-grasp calibrate add")
    session = HandEyeSession.open(cfg.folder)
    T_base_tcp = _told_pose(cfg)
    try:
        picture = imageio.imread(cfg.picture)
    except (OSError, ValueError) as error:
        raise CalibrationError(f"the picture '{cfg.picture}' cannot be read: {error}.") from error
    sample = session.add(picture[..., :3] if picture.ndim == 3 else picture, T_base_tcp, q_rad=cfg.joints)
    if isinstance(sample, Refused):
        print(f"not taken, {sample.reason.value}: {sample.sentence}")
        return 1
    print(f"sample {sample.name}: corners to {sample.reprojection_px:.2f} px")
    _say_coverage(session)
    return 0


def status(args: list[str]) -> int:
    """What is missing, and where to go next."""
    cfg = parse(StatusCfg, args, prog="tr-grasp calibrate status")
    session = HandEyeSession.open(cfg.folder)
    _say_coverage(session)
    if cfg.robot is not None:
        place = session.place(_rough_camera(cfg, session.cfg.setup))
        view = session.suggest(_kinematics(cfg.robot), *place, np.random.default_rng(cfg.seed))
        print(f"go next to joints [rad]  {' '.join(f'{q:.4f}' for q in view.q_rad)}")
        print(f"where T_base_tcp is      {_pose_words(view.T_base_tcp)}  (x y z, w x y z)")
    return 0


def solve(args: list[str]) -> int:
    """Calibrate from a session."""
    cfg = parse(SolveCfg, args, prog="tr-grasp calibrate solve")
    session = HandEyeSession.open(cfg.folder)
    _finish(session, session.solve(cfg.method, refine=cfg.refine), "solve", args)
    return 0


def report(args: list[str]) -> int:
    """Write the report of a session again."""
    cfg = parse(SolveCfg, args, prog="tr-grasp calibrate report", description="Write a session's HTML report.")
    session = HandEyeSession.open(cfg.folder)
    print(_write_report(session, session.solve(cfg.method, refine=cfg.refine), "report", args))
    return 0


def import_samples(args: list[str]) -> int:
    """Make a session of another tool's samples."""
    cfg = parse(ImportCfg, args, prog="tr-grasp calibrate import")
    setup, pairs = read_samples(cfg.file, cfg.setup)
    if setup is None:
        raise CalibrationError(f"'{cfg.file}' does not say where the camera was; give --setup {' or '.join(SETUPS)}.")
    session = HandEyeSession.create(cfg.folder, SessionCfg(setup))
    for T_base_tcp, T_cam_board in pairs:
        session.add_poses(T_base_tcp, T_cam_board)
    print(f"{cfg.folder}: {len(pairs)} samples, {setup}")
    _say_coverage(session)
    return 0


WORDS: dict[str, Callable[[list[str]], int]] = {
    "board": board,
    "simulate": simulate,
    "new": new,
    "add": add,
    "status": status,
    "solve": solve,
    "report": report,
    "import": import_samples,
}


def _finish(
    session: HandEyeSession, result: HandEyeResult, word: str, args: list[str], truth: Array | None = None
) -> None:
    """Say the result; write it and the report into the session's folder."""
    for sentence in result.warnings:
        print(f"look: {sentence}")
    sure = result.uncertainty
    print(f"{result.name}  {_pose_words(result.T_parent_cam)}  (x y z, w x y z)")
    radius = f"{1e3 * sure.translation_m:.2f} mm, {np.degrees(sure.rotation_rad):.3f} deg"
    print(f"95 % sure to within      {radius}, if intrinsics are right")
    if result.held_out_m is not None:
        turned = np.degrees(result.held_out_rad or 0.0)
        print(f"samples held out are off {1e3 * result.held_out_m:.2f} mm, {turned:.3f} deg on average")
    if truth is not None:
        off, turned = distance_m(result.T_parent_cam, truth), np.degrees(angle_rad(result.T_parent_cam, truth))
        print(f"the truth is             {1e3 * off:.2f} mm, {turned:.3f} deg away")
    print(static_transform(record_of(result, session.cfg.frames)))
    print(save_calibration(result, session.cfg.frames, session.folder / CALIBRATION))
    print(_write_report(session, result, word, args, truth))


def _write_report(
    session: HandEyeSession, result: HandEyeResult, word: str, args: list[str], truth: Array | None = None
) -> Path:
    source = provenance(shlex.join(["tr-grasp", "calibrate", word, *args]))
    path = session.folder / REPORT
    write_atomically(path, calibration_html(session, result, source, truth))
    return path


def _say_coverage(session: HandEyeSession) -> None:
    coverage = session.coverage
    print(
        f"samples: {coverage.samples_n}, turned by up to {coverage.turn_deg:.0f} degrees about axes that spread by "
        f"{coverage.spread_deg:.0f}, moved by up to {coverage.way_m:.2f} m"
    )
    for sentence in coverage.missing:
        print(f"missing: {sentence}")
    if not coverage.missing:
        print("nothing is missing: solve")


def _rough_camera(cfg: StatusCfg, setup: Setup) -> Array | None:
    """The camera as the flags say it."""
    if (cfg.camera_at is None) != (cfg.looks_at is None):
        raise CalibrationError("give --camera-at and --looks-at together.")
    if cfg.camera_at is None or cfg.looks_at is None:
        return None
    up = cfg.up or ((0.0, 0.0, 1.0) if setup == "eye_on_base" else (0.0, -1.0, 0.0))
    try:
        return look_at(cfg.camera_at, cfg.looks_at, up)
    except ValueError as error:
        raise CalibrationError(f"--camera-at, --looks-at and --up do not go together: {error}.") from error


def _told_pose(cfg: AddCfg) -> Array:
    if (cfg.pose is None) == (cfg.joints is None):
        raise CalibrationError("give either --pose or --joints with --robot.")
    if cfg.pose is not None:
        if not 0.99 < np.linalg.norm(cfg.pose[3:]) < 1.01:
            raise CalibrationError(f"the quaternion w x y z of --pose must have length 1, got {cfg.pose[3:]}.")
        return transform_from(matrix_from_wxyz(cfg.pose[3:]), cfg.pose[:3])
    if cfg.robot is None or cfg.joints is None:
        raise CalibrationError("joints say nothing without --robot.")
    return _kinematics(cfg.robot).pose(cfg.joints)


def _kinematics(robot: str) -> Kinematics:
    return Kinematics(robot_spec(robot))


def _pose_words(T: Array) -> str:
    return " ".join(f"{v:.5f}" for v in (*T[:3, 3], *wxyz_from_matrix(T[:3, :3])))
