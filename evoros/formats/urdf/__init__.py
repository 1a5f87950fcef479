"""Reading of URDF and xacro robot descriptions, and merging of fixed links."""
