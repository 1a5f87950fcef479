"""The master of ROS 1 in a mission, and the parameters that it serves.

Standard library only, because the nodes can start before this process has imported rospy.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from typing import Any
from xmlrpc.client import Fault, ServerProxy

PORT = 11311  # at which nodes expect the master
LARGEST_SEED = 2**31  # parameters are of 32 bits, one of them the sign
TOLD = ("sensors", "drive", "home", "route", "acceptance_m", "time_limit_s", "period_s")
PROGRAM = """
import sys, time
from rosmaster.master import Master
master = Master(int(sys.argv[1]), num_workers=1)
master.start()
while master.ok():
    time.sleep(0.5)
"""


def start_master(isolated: bool, until: float) -> dict[str, str]:
    """Start a master in a process of its own; return the environment in which nodes find it.

    The threads of a master in this process would wait for this process's interpreter. ``until``
    limits the start, as of the monotonic clock [s].

    Raises:
        TimeoutError: the master does not answer.
    """
    port = PORT if isolated else _free_port()
    folder = os.getcwd()
    environment = {name: value for name, value in os.environ.items() if name != "ROS_HOSTNAME"}
    environment["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    environment.update(ROS_IP="127.0.0.1", ROS_HOME=folder, ROS_LOG_DIR=folder)
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(port)], env=environment)
    while process.poll() is None and time.monotonic() < until:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return environment
        except ConnectionRefusedError:
            time.sleep(0.005)
    raise TimeoutError("the ROS master did not start")


def _free_port() -> int:
    with socket.socket() as any_socket:
        any_socket.bind(("127.0.0.1", 0))
        return int(any_socket.getsockname()[1])


def set_parameters(address: str, briefing: dict[str, Any]) -> None:
    """Set the parameters of a mission.

    Raises:
        ValueError: one cannot be a parameter of ROS 1.
    """
    master = ServerProxy(address)
    for name, value in _parameters(briefing).items():
        try:
            master.setParam("/evoros", name, value)
        except (TypeError, OverflowError, Fault) as error:
            raise ValueError(
                f"controller.parameters.{name[1:]}: must be a number, a text, true or false, or "
                f"lists and mappings of them ({error}); change it"
            ) from None


def _parameters(briefing: dict[str, Any]) -> dict[str, Any]:
    return {
        **{f"/{name}": value for name, value in briefing["parameters"].items()},
        "/use_sim_time": True,
        "/robot_description": briefing["ros"]["description"],
        "/evoros": {
            **{name: briefing[name] for name in TOLD},
            "seed": briefing["seed"] % LARGEST_SEED,
        },
    }
