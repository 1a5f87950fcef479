"""Drives, which convert a command to the motion of a robot's wheels.

A robot that does not fit its drive raises an InputError that names the joint, the rule and the fix.
"""
