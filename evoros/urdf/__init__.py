"""Robot descriptions: xacro expansion, and a strict reading of URDF."""
