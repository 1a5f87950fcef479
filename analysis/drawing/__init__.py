"""Shared drawing: style, pages of panels, text tables, and top views of robots and worlds."""
