"""The physical plausibility report."""

from sim.report.assess import judge
from sim.report.clip_metrics import Measured
from sim.report.compare import compare
from sim.report.result import Finding, Report

__all__ = ["Finding", "Measured", "Report", "compare", "judge"]
