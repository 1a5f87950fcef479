"""A champion as a package for the robot: parameters, frames and a drawing of its mounts."""
