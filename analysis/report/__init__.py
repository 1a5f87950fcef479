"""The report: one HTML page of a whole study."""
