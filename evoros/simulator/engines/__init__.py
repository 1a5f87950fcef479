"""The implementations of the planar simulator, MuJoCo and PyBullet."""
