"""Strict readers and writers of URDF, SDF and meshes; errors name file, line and element."""
