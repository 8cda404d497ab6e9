"""The physical plausibility report."""

from sim.report.compare import compare
from sim.report.judge import judge
from sim.report.measured import Measured
from sim.report.result import Finding, Report

__all__ = ["Finding", "Measured", "Report", "compare", "judge"]
