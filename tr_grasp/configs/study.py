"""A study: one question, and the runs that answer it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tr_grasp.configs.io import apply, read_mapping
from tr_grasp.configs.train import TrainCfg
from tr_grasp.errors import ConfigError, unknown_name

_STUDIES = Path(__file__).parent / "studies"
_FIELDS = ("question", "runs")


@dataclass(frozen=True)
class Study:
    """Runs that differ in what the question asks, by label; the first one is what the others are compared with."""

    name: str
    question: str
    runs: Mapping[str, TrainCfg]


def study_names() -> list[str]:
    """Names of the studies that come with the package."""
    return sorted(path.stem for path in _STUDIES.glob("*.yaml"))


def load_study(name_or_path: str | Path) -> Study:
    """Read a study.

    A file looks like this::

        question: Does colour help?
        runs:
          with colour: {extends: grasp}
          without: {extends: grasp, env: {observation: {colour: false}}}

    Args:
        name_or_path: One that comes with the package, or a YAML file.

    Raises:
        ConfigError: No such study, not YAML, other names than ``question`` and ``runs``, fewer than two runs, or a run
            whose settings are wrong.
    """
    path = _STUDIES / f"{name_or_path}.yaml" if str(name_or_path) in study_names() else Path(name_or_path)
    if not path.is_file():
        raise ConfigError(
            f"{unknown_name('study', str(name_or_path), study_names())} The path of a YAML file works too."
        )
    source = f"studies/{path.name}" if path.parent == _STUDIES else str(path)
    content = read_mapping(path, source)
    if sorted(content) != sorted(_FIELDS):
        raise ConfigError(f"{source}: a study has {' and '.join(_FIELDS)}, got {', '.join(content) or 'nothing'}")
    runs = content["runs"]
    if not isinstance(runs, dict) or len(runs) < 2:
        raise ConfigError(f"{source}: runs: give at least two, as 'label: {{extends: preset}}'")
    cfgs = {}
    for label, delta in runs.items():
        if not isinstance(delta, dict):
            raise ConfigError(f"{source}: runs: {label}: expected settings as 'name: value', got {delta!r}")
        cfgs[str(label)] = apply(TrainCfg(), delta, source=f"{source}: runs: {label}", beside=path.parent)
    return Study(path.stem, str(content["question"]), cfgs)
