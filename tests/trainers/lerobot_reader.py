"""A reader of LeRobot v3.0 data sets, written from the published layout: nothing of it comes from the writer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

ARROW = {"float32": pa.float32(), "int64": pa.int64(), "int16": pa.int16(), "bool": pa.bool_()}
REQUIRED = {"timestamp", "frame_index", "episode_index", "index", "task_index"}


class LeRobotV3:
    """Finds everything by way of ``meta/info.json``, and checks what it finds against it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.info = json.loads((root / "meta/info.json").read_text())
        assert self.info["codebase_version"] == "v3.0"
        assert set(self.info["features"]) >= REQUIRED
        self.stats = json.loads((root / "meta/stats.json").read_text())
        self.tasks = self._tasks()
        paths = sorted((root / "meta/episodes").glob("chunk-*/file-*.parquet"))
        self.episodes = pa.concat_tables([pq.read_table(path) for path in paths]).to_pylist()
        assert len(self.episodes) == self.info["total_episodes"]
        assert sum(episode["length"] for episode in self.episodes) == self.info["total_frames"]
        assert len(self.tasks) == self.info["total_tasks"]

    def _tasks(self) -> dict[int, str]:
        table = pq.read_table(self.root / "meta/tasks.parquet")
        index = json.loads(table.schema.metadata[b"pandas"])["index_columns"][0]
        return dict(zip(table["task_index"].to_pylist(), table[index].to_pylist(), strict=True))

    def episode(self, number: int) -> dict[str, np.ndarray]:
        """Feature to ``(length, *shape)``."""
        row: dict[str, Any] = self.episodes[number]
        path = self.info["data_path"].format(chunk_index=row["data/chunk_index"], file_index=row["data/file_index"])
        table = pq.read_table(self.root / path)
        offset = row["dataset_from_index"] - table["index"][0].as_py()
        part = table.slice(offset, row["dataset_to_index"] - row["dataset_from_index"])
        assert len(part) == row["length"]
        return {name: self._column(part, name, feature) for name, feature in self.info["features"].items()}

    @staticmethod
    def _column(table: pa.Table, name: str, feature: dict[str, Any]) -> np.ndarray:
        values, shape, dtype = table[name].combine_chunks(), feature["shape"], ARROW[feature["dtype"]]
        if shape == [1]:
            assert values.type == dtype, name
            return values.to_numpy(zero_copy_only=False)
        assert values.type == pa.list_(dtype, shape[0]), name
        return values.flatten().to_numpy().reshape(len(table), *shape)
