"""What a machine needs to run this package, and how to mend what is missing.

:func:`examine` asks the machine (:func:`probe`) and judges the answers (:data:`CHECKS`). The judges are
pure functions of a :class:`Machine`, so every fault can be made up. Standard library only: this must
run where everything else is broken.
"""

from tr_grasp.doctor.checks import CHECKS, Finding, Severity, examine
from tr_grasp.doctor.machine import SYSTEM_LIBRARIES, Machine, SystemLibrary
from tr_grasp.doctor.probe import probe, probe_vulkan

__all__ = [
    "CHECKS",
    "SYSTEM_LIBRARIES",
    "Finding",
    "Machine",
    "Severity",
    "SystemLibrary",
    "examine",
    "probe",
    "probe_vulkan",
]
