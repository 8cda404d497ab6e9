"""MJCF humanoids as retargeting targets."""

import sim as sim  # which chooses how MuJoCo draws, before MuJoCo is imported

DISTRIBUTION = "spark-sim"
