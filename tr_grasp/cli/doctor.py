"""``tr-grasp doctor``: what this machine has, what it lacks, and the cure."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from tr_grasp.doctor import Finding, Machine, Severity, examine, probe


def main(args: list[str], probe: Callable[[], Machine] = probe) -> int:
    """Print one line a check.

    Args:
        args: None but ``--help``.
        probe: Where the facts come from.

    Returns:
        0 when everything needed works (warnings included), 1 when something is broken.
    """
    parser = argparse.ArgumentParser(prog="tr-grasp doctor", description=__doc__, allow_abbrev=False)
    parser.parse_args(args)
    print("asking the machine (some seconds) ...", flush=True)
    findings = examine(probe())
    for finding in findings:
        print(_line(finding))
    broken = [finding.subject for finding in findings if finding.severity is Severity.BROKEN]
    print(f"broken: {', '.join(broken)}" if broken else "everything that is needed works")
    return 1 if broken else 0


def _line(finding: Finding) -> str:
    cure = f" -> {finding.cure}" if finding.cure else ""
    return f"{finding.severity.value:4}  {finding.subject:9}  {finding.fact}{cure}"
