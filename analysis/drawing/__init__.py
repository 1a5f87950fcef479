"""Shared drawing: style, pages of panels, tables of text, robots and worlds from above."""
