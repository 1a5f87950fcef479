"""Figures from run folders: one module a figure, each a plain function from tables to matplotlib."""
