"""The application: command line and public Python API."""

DISTRIBUTION = "spark-sim"
