"""Figures, tables, videos and reports from run folders; no code of a run is imported."""
