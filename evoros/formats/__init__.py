"""Strict readers and writers of URDF, SDF and meshes, whose errors name file, line and element."""
