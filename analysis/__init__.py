"""Figures from run folders: a module a figure, each a plain function from tables to matplotlib."""
