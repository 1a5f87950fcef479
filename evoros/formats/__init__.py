"""Strict readers and writers of URDF, SDF, CSV and meshes.

Input that a reader cannot understand raises an InputError with file, line, element, rule and fix.
"""
