"""Evaluates retargeting methods against ground truths: metrics, test cases, tables."""
