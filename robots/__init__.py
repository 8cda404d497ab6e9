"""MJCF humanoids as retargeting targets."""

DISTRIBUTION = "spark-sim"
