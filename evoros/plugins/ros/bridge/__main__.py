"""Starts a bridge in the user's ROS Python: ``python FOLDER ros1`` or ``python FOLDER ros2``."""

import os
import sys
from importlib import import_module

folder, name = os.path.split(os.path.dirname(os.path.abspath(__file__)))
sys.path[0] = folder
import_module(name)
del sys.path[0]  # the folder also contains modules outside the package
import_module(f"{name}.{sys.argv[1]}").main()
