"""Methods against ground truths: metrics, cases, tables."""
