"""Whole trajectories on robots: one least-squares problem over all frames."""
