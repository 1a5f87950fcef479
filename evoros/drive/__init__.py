"""Drives: from a command to the wheels of a robot.

A robot that does not fit its drive raises an InputError that names the joint, the rule and the fix.
"""
