"""Numbers computed from tables: statistics, and measures of designs and runs."""
