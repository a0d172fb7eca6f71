"""What a run leaves on the disk, and where."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from torch.utils.tensorboard import SummaryWriter

from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import dump_yaml
from tr_grasp.errors import StorageError
from tr_grasp.files import remove_partial_files, write_atomically
from tr_grasp.trainers.checkpoint import CHECKPOINT_FILE

_STEP = "env_steps"


class RunFolder:
    """The files of one run.

    ``config.yaml``, ``training.json``, ``progress.csv``, TensorBoard events, ``checkpoint.pt``, and the saved policies
    ``best`` and ``last``.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._rows: list[dict[str, float]] = []
        self._writer: SummaryWriter | None = None

    @property
    def checkpoint(self) -> Path:
        """The checkpoint's file."""
        return self.path / CHECKPOINT_FILE

    @property
    def best(self) -> Path:
        """Folder of the policy with the best evaluation so far."""
        return self.path / "best"

    @property
    def last(self) -> Path:
        """Folder of the newest policy."""
        return self.path / "last"

    def open(self, cfg: TrainCfg, rows: Sequence[Mapping[str, float]] = (), env_steps: int | None = None) -> None:
        """Make the folder, write the settings and begin to log.

        Args:
            cfg: The settings of the run.
            rows: Progress up to the checkpoint that is resumed; what was logged after it is dropped.
            env_steps: Where the checkpoint stands; None for a new run.

        Raises:
            StorageError: The folder cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageError(f"could not make the run folder '{self.path}': {error.strerror}.") from error
        remove_partial_files(self.path)
        write_atomically(self.path / "config.yaml", dump_yaml(cfg))
        self._rows = [dict(row) for row in rows]
        self._write_csv()
        purge = None if env_steps is None else env_steps + 1
        self._writer = SummaryWriter(str(self.path / "tensorboard"), purge_step=purge)

    @property
    def rows(self) -> list[dict[str, float]]:
        """Everything logged so far, one row a time, each with ``env_steps``."""
        return self._rows

    def log(self, row: Mapping[str, float]) -> None:
        """Add one row to the CSV and to TensorBoard.

        Raises:
            StorageError: The CSV cannot be written; it still holds the rows before.
        """
        self._rows.append(dict(row))
        self._write_csv()
        if self._writer is not None:
            for name, value in row.items():
                if name != _STEP:
                    self._writer.add_scalar(name, value, int(row[_STEP]))

    def write_record(self, record: Mapping[str, Any]) -> None:
        """Replace ``training.json``."""
        write_atomically(self.path / "training.json", json.dumps(record, indent=2) + "\n")

    def close(self) -> None:
        """Flush TensorBoard."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _write_csv(self) -> None:
        names = list(dict.fromkeys([_STEP, *(name for row in self._rows for name in row)]))
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, names)
        writer.writeheader()
        writer.writerows(self._rows)
        write_atomically(self.path / "progress.csv", text.getvalue())
