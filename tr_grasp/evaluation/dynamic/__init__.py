"""Judging ways to grasp what moves: trials, tables beside the thesis', report."""
