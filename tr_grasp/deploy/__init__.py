"""A policy of Task I on a station: what its camera sees becomes octrees, its actions become joint motion."""

from tr_grasp.deploy.cartesian import CartesianSteps, Execution
from tr_grasp.deploy.log import RunLog, RunStep
from tr_grasp.deploy.observe import CalibratedCamera, Observer
from tr_grasp.deploy.runner import PolicyRun, RunEnding, RunResult

__all__ = [
    "CalibratedCamera",
    "CartesianSteps",
    "Execution",
    "Observer",
    "PolicyRun",
    "RunEnding",
    "RunLog",
    "RunResult",
    "RunStep",
]
