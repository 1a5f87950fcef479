"""Starts a bridge: ``python FOLDER ros1`` or ``ros2``, by the user's ROS Python.

The scripts are a package by the name of this folder. evoros itself is not on their path.
"""

import os
import sys
from importlib import import_module

folder, name = os.path.split(os.path.dirname(os.path.abspath(__file__)))
sys.path[0] = folder
import_module(name)
del sys.path[0]  # which has modules beside this package
import_module(f"{name}.{sys.argv[1]}").main()
