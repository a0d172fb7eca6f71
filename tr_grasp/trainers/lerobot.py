"""Demonstrations as a LeRobot dataset, format v3.0, without importing LeRobot.

    meta/info.json      features, sizes, paths
    meta/stats.json     of every feature over all episodes
    meta/tasks.parquet  what the robot was told
    meta/episodes/chunk-000/file-000.parquet    where each episode lies, and its statistics
    data/chunk-000/file-000.parquet             one row a step

Source: the reader and writer of lerobot 0.4 (``CODEBASE_VERSION = "v3.0"``). There are no pictures, so no videos: a
step has the proprioception as ``observation.state`` and the octree as two flat lists, ``observation.octree.codes`` and
``observation.octree.features``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import ConfigError, DemonstrationError
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.keys import ACTION, EXPERT_ACTION, PROPRIO
from tr_grasp.trainers.demonstration import Demonstration
from tr_grasp.trainers.demonstration_file import DemonstrationFile

if TYPE_CHECKING:
    import pyarrow as pa

VERSION = "v3.0"
TASK = "grasp one of the objects and lift it"
BYTES_PER_FILE = 100_000_000
"""As LeRobot's own writer; before compression."""
FILES_PER_CHUNK = 1000
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
ACTION_NAMES = ["dx", "dy", "dz", "dphi", "gripper"]
STATE_NAMES = ["gripper", *(f"tcp_{a}" for a in "xyz"), *(f"R_{row}{column}" for column in "xy" for row in "xyz")]
NAMES = {ACTION: ACTION_NAMES, EXPERT_ACTION: ACTION_NAMES, "observation.state": STATE_NAMES}
OCTREE_CODES, OCTREE_FEATURES = "observation.octree.codes", "observation.octree.features"
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Columns = dict[str, NDArray]
"""Feature to ``(T, ...)``, one row a step."""


@dataclass(frozen=True)
class ExportedDataset:
    """What was written."""

    folder: Path
    episodes_n: int
    steps_n: int


def export_lerobot(
    file: DemonstrationFile,
    folder: Path,
    *,
    successes_only: bool = False,
    on_episode: Callable[[int], object] = lambda index: None,
) -> ExportedDataset:
    """Write a dataset that ``LeRobotDataset(repo_id, root=folder)`` opens.

    Args:
        file: The demonstrations.
        folder: Where to; made, and must be empty if it is there.
        successes_only: Leave out episodes in which nothing was lifted.
        on_episode: Told the index of each episode that was read.

    Raises:
        DemonstrationError: The folder is not empty, or there is no episode to write.
        ConfigError: pyarrow is not installed.
        StorageError: Something could not be written.
    """
    _require_pyarrow()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DemonstrationError(f"'{folder}' is not an empty folder; name another one.")
    chosen = [index for index, episode in enumerate(file.episodes) if episode.success or not successes_only]
    if not chosen:
        what = "no episode in which something was lifted" if len(file) else "no episode"
        raise DemonstrationError(f"'{file.path}' holds {what}, so there is nothing to export.")
    fps = file.recording.env.control_hz
    writer = _Writer(folder)
    for episode, index in enumerate(chosen):
        writer.add(episode_columns(file[index], episode, writer.steps_n, fps))
        on_episode(index)
    writer.finish(robot=file.recording.env.robot, fps=int(fps) if fps == int(fps) else fps)
    return ExportedDataset(folder, len(chosen), writer.steps_n)


def episode_columns(demonstration: Demonstration, episode: int, first_index: int, fps: float) -> Columns:
    """The rows of one episode.

    Args:
        demonstration: The episode.
        episode: Its number in the data set.
        first_index: Steps of all episodes before it.
        fps: Steps per second.
    """
    steps, arrays = demonstration.info.steps, demonstration.arrays
    done = (arrays["terminated"] | arrays["truncated"])[:, 0]
    frame = np.arange(steps)
    columns = {
        "observation.state": arrays[PROPRIO][:-1],
        OCTREE_CODES: arrays["codes"][:-1],
        OCTREE_FEATURES: arrays["features"][:-1].astype(np.float32).reshape(steps, -1),
        ACTION: arrays[ACTION],
        EXPERT_ACTION: arrays[EXPERT_ACTION][:-1],
        "next.reward": arrays["reward"][:, 0],
        "next.done": done,
        "next.success": (frame == steps - 1) & demonstration.info.success,
        "timestamp": (frame / fps).astype(np.float32),
        "frame_index": frame,
        "episode_index": np.full(steps, episode),
        "index": first_index + frame,
        "task_index": np.zeros(steps, np.int64),
    }
    return columns


class _Writer:
    """Takes episodes one after the other; what describes them all is written at the end."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._rows: list[dict[str, Any]] = []
        self._pending: list[Columns] = []
        self._described: list[Columns] = []
        self._files_n = 0
        self._features: dict[str, Any] = {}
        self.steps_n = 0

    def add(self, columns: Columns) -> None:
        size = sum(column.nbytes for part in (*self._pending, columns) for column in part.values())
        if self._pending and size > BYTES_PER_FILE:
            self._flush()
        steps = len(columns["index"])
        described = {name: column for name, column in columns.items() if name not in (OCTREE_CODES, OCTREE_FEATURES)}
        self._rows.append(
            {
                "episode_index": len(self._rows),
                "tasks": [TASK],
                "length": steps,
                "data/chunk_index": self._files_n // FILES_PER_CHUNK,
                "data/file_index": self._files_n % FILES_PER_CHUNK,
                "dataset_from_index": self.steps_n,
                "dataset_to_index": self.steps_n + steps,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **{f"stats/{name}/{key}": value for name, key, value in _flat(described)},
            }
        )
        self._features = _features(columns)
        self._pending.append(columns)
        self._described.append(described)
        self.steps_n += steps

    def finish(self, *, robot: str, fps: float) -> None:
        import pyarrow as pa

        self._flush()
        whole = {name: np.concatenate([part[name] for part in self._described]) for name in self._described[0]}
        self._write("meta/stats.json", _json({name: statistics(column) for name, column in whole.items()}))
        self._write_table(EPISODES_PATH, pa.Table.from_pylist(self._rows))
        self._write_table("meta/tasks.parquet", _tasks_table())
        info = {
            "codebase_version": VERSION,
            "robot_type": robot,
            "total_episodes": len(self._rows),
            "total_frames": self.steps_n,
            "total_tasks": 1,
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": BYTES_PER_FILE // 1_000_000,
            "video_files_size_in_mb": 200,
            "fps": fps,
            "splits": {"train": f"0:{len(self._rows)}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": self._features,
        }
        # Last, because a data set without it is none.
        self._write("meta/info.json", _json(info))

    def _flush(self) -> None:
        import pyarrow as pa

        columns = {name: np.concatenate([part[name] for part in self._pending]) for name in self._pending[0]}
        chunk, file = divmod(self._files_n, FILES_PER_CHUNK)
        path = DATA_PATH.format(chunk_index=chunk, file_index=file)
        self._write_table(path, pa.table({name: _arrow(column) for name, column in columns.items()}))
        self._pending, self._files_n = [], self._files_n + 1

    def _write_table(self, path: str, table: pa.Table) -> None:
        import pyarrow.parquet as pq

        self._write(path, lambda file: pq.write_table(table, file, compression="snappy"))

    def _write(self, path: str, content: Any) -> None:
        make_folder((self._folder / path).parent)
        write_atomically(self._folder / path, content)


def statistics(column: NDArray) -> dict[str, list[float]]:
    """What LeRobot's normalisers ask for, of each component of ``(T, ...)`` numbers."""
    values = column.reshape(len(column), -1).astype(np.float64)
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
    return {
        "min": values.min(0).tolist(),
        "max": values.max(0).tolist(),
        "mean": values.mean(0).tolist(),
        "std": values.std(0).tolist(),
        "count": [len(values)],
        **{name: row.tolist() for name, row in zip(QUANTILES, quantiles, strict=True)},
    }


def _flat(columns: Columns) -> Iterator[tuple[str, str, list[float]]]:
    for name, column in columns.items():
        yield from ((name, key, value) for key, value in statistics(column).items())


def _features(columns: Columns) -> dict[str, Any]:
    return {
        name: {"dtype": str(column.dtype), "shape": list(column.shape[1:]) or [1], "names": NAMES.get(name)}
        for name, column in columns.items()
    }


def _arrow(column: NDArray) -> pa.Array:
    """(T,) becomes a plain column, (T, n) lists of one length."""
    import pyarrow as pa

    flat = pa.array(column.reshape(-1))
    return flat if column.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, column.shape[1])


def _tasks_table() -> pa.Table:
    """A table whose index is the task: LeRobot reads it with pandas, and looks tasks up by their place in it."""
    import pyarrow as pa

    index = "__index_level_0__"
    columns = [
        {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64"},
        {"name": None, "field_name": index, "pandas_type": "unicode", "numpy_type": "object"},
    ]
    described: Mapping[str, Any] = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [{**column, "metadata": None} for column in columns],
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array([0]), index: pa.array([TASK])})
    return table.replace_schema_metadata({"pandas": json.dumps(described)})


def _json(content: Mapping[str, Any]) -> str:
    return json.dumps(content, indent=4) + "\n"


def _require_pyarrow() -> None:
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise ConfigError("--format lerobot needs the package pyarrow: pip install 'tr-grasp[lerobot]'.") from None
