"""The physical plausibility report."""

from sim.report.assess import assess
from sim.report.clip_metrics import ClipMetrics
from sim.report.compare import compare
from sim.report.result import Finding, Report

__all__ = ["ClipMetrics", "Finding", "Report", "assess", "compare"]
