"""The physical plausibility report."""

from sim.report.judge import judge
from sim.report.result import Finding, Measured, Report

__all__ = ["Finding", "Measured", "Report", "judge"]
