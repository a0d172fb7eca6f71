"""``tr-grasp doctor``: one line a check, and an exit code that tells."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.doctor.test_checks import FAULTS, HEALTHY
from tr_grasp.cli.doctor import main
from tr_grasp.doctor import CHECKS, Severity


def test_a_healthy_machine_is_told_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([], probe=lambda: HEALTHY) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(CHECKS) + 2
    assert lines[-1] == "everything that is needed works"


@pytest.mark.parametrize("fault", FAULTS)
def test_the_exit_code_says_whether_something_needed_is_broken(fault: str, capsys: pytest.CaptureFixture[str]) -> None:
    machine, subject, severity, _, cure = FAULTS[fault]
    assert main([], probe=lambda: machine) == (1 if severity is Severity.BROKEN else 0)
    [line] = [
        line for line in capsys.readouterr().out.splitlines() if line.startswith(f"{severity.value:4}  {subject}")
    ]
    assert cure in line


def test_all_that_is_broken_is_summed_up(capsys: pytest.CaptureFixture[str]) -> None:
    machine = replace(HEALTHY, python=(3, 9, 0), free_bytes=0)
    assert main([], probe=lambda: machine) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "broken: python, storage"
