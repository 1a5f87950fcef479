"""Drives, which convert a command to the motion of a robot's wheels.

If a robot does not fit its drive, an InputError names the joint, the rule and the fix.
"""
