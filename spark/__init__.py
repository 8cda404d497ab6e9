"""Skeletons, motions and their transfer from one body to another."""

DISTRIBUTION = "spark-sim"
