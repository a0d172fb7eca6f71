"""Pick and place at taught poses, or where a camera sees the object: planned, timed, carried out, tried again."""

from tr_grasp.pick_place.blind import BlindPickPlace
from tr_grasp.pick_place.find import find_object
from tr_grasp.pick_place.outcome import StageRecord, TaskOutcome, TaskResult
from tr_grasp.pick_place.perceive import GraspChoice, Perception
from tr_grasp.pick_place.plan import PlannedStage, TaskPlan, plan_stages
from tr_grasp.pick_place.scene import PlanningScene
from tr_grasp.pick_place.station import BoxCfg, ObjectCfg, PoseCfg, StageCfg, StationCfg
from tr_grasp.pick_place.station_file import read_station, station_names

__all__ = [
    "BlindPickPlace",
    "BoxCfg",
    "GraspChoice",
    "ObjectCfg",
    "Perception",
    "PlannedStage",
    "PlanningScene",
    "PoseCfg",
    "StageCfg",
    "StageRecord",
    "StationCfg",
    "TaskOutcome",
    "TaskPlan",
    "TaskResult",
    "find_object",
    "plan_stages",
    "read_station",
    "station_names",
]
