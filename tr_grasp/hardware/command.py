"""A command that was given to a device: how far it is, how it ended, and a way to call it off."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass


class Ending(enum.Enum):
    """How a command ended; ``label`` is for people."""

    DONE = "it was carried out"
    HOLDING = "an object stopped the fingers"
    CANCELLED = "it was cancelled"
    SUPERSEDED = "another command took over"
    STOPPED = "a stop was ordered"
    REFUSED = "it was refused, and nothing moved for it"
    FAULT = "the device failed"

    @property
    def label(self) -> str:
        """A clause for people."""
        return self.value


@dataclass(frozen=True)
class Result:
    """How a command ended, and what exactly was the matter; ``detail`` is empty where nothing was."""

    ending: Ending
    detail: str = ""

    @property
    def succeeded(self) -> bool:
        """It was carried out, as far as an object allowed."""
        return self.ending in (Ending.DONE, Ending.HOLDING)

    @property
    def reason(self) -> str:
        """A sentence for people."""
        return f"{self.ending.label}{': ' if self.detail else ''}{self.detail}"


class Command:
    """Handle of a command. Devices write ``progress`` and call :meth:`end`; everybody else reads and cancels.

    Args:
        cancel: How the device calls it off.

    Attributes:
        progress: From 0 to 1.
        result: How it ended; nothing while it goes on.
    """

    def __init__(self, cancel: Callable[[Command], None]) -> None:
        self.progress = 0.0
        self.result: Result | None = None
        self._cancel = cancel

    @classmethod
    def ended(cls, ending: Ending, detail: str = "") -> Command:
        """One that ended before anything moved."""
        command = cls(lambda _: None)
        command.end(ending, detail)
        return command

    @classmethod
    def refused(cls, detail: str) -> Command:
        """One that was not accepted, and why."""
        return cls.ended(Ending.REFUSED, detail)

    @property
    def done(self) -> bool:
        """It has ended, one way or another."""
        return self.result is not None

    def cancel(self) -> None:
        """Call it off: the device comes to rest. Of a command that has ended, nothing happens."""
        if not self.done:
            self._cancel(self)

    def end(self, ending: Ending, detail: str = "") -> None:
        """Say how it ended; only the first time counts."""
        if self.result is None:
            self.result = Result(ending, detail)
            if self.result.succeeded:
                self.progress = 1.0
