"""The physical plausibility report."""

from sim.report.assess import assess
from sim.report.clip_metrics import ClipMetrics
from sim.report.compare import compare
from sim.report.report import Report
from sim.report.result import Finding
from sim.trajectory import Subject

__all__ = ["ClipMetrics", "Finding", "Report", "Subject", "assess", "compare"]
