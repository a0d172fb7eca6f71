"""Kinematics, planning and timing in one go: ``TR_GRASP_BENCH_CLOCK=cpu python -m benchmarks.motion``.

Prints the JSON rows of the three benchmarks, as they stand in ``docs/results/motion.md``.
"""

from benchmarks import kinematics, planning, timing


def main() -> None:
    """Print all rows."""
    for part in (kinematics, timing, planning):
        part.main([])


if __name__ == "__main__":
    main()
