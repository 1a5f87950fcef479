"""From tables to numbers: statistics, and what designs and runs are like."""
