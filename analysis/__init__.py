"""Figures, tables, videos and reports from run folders; never runs a part of the user's."""
