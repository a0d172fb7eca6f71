"""Judging: seeded episodes, statistics, comparisons, reports.

Nothing is imported here, so that comparing two files of results does not load a simulator.
"""
