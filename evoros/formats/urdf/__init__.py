"""URDF and xacro robot descriptions: reads them and merges their fixed links."""
