"""Commands, parameters and environment of ROS 2 nodes, set up before rclpy is imported."""

from __future__ import annotations

import json
import os
import socket
from typing import Any, NamedTuple

PARAMETERS, PLACEHOLDER = "parameters.yaml", "{parameters}"
ELSEWHERE = ("ROS_DISCOVERY_SERVER", "ROS_SUPER_CLIENT", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY")
"""Variables that point to nodes on other machines, or that newer variables replace."""
BEFORE_RANGES = ("foxy", "galactic", "humble")  # they lack ROS_AUTOMATIC_DISCOVERY_RANGE
FAST = "rmw_fastrtps"
PROFILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "local.xml")
"""Keeps Fast DDS on this machine and out of shared memory, where files would remain after a kill.
"""
FIRST_PORT, PORTS_PER_DOMAIN, DOMAINS = 7400, 250, 101  # DDS ports below Linux's ephemeral range


class Group(NamedTuple):
    """The nodes of one command, or of all launch files, which receive messages together.

    Groups have a topic ``prefix``, as a DDS publisher reaches all subscriptions at once.
    """

    prefix: str
    commands: list[list[str]]  # commands as configured


def topic_names(briefing: dict[str, Any]) -> list[str]:
    """Return the topics published by evoros, except the transforms."""
    topics = briefing["ros"]["topics"]
    ranges = [topics["range"].replace("{sensor}", sensor["name"]) for sensor in briefing["sensors"]]
    return [*ranges, topics["odometry"], topics["goal"], topics["route"], "/clock"]


def group(commands: list[list[str]]) -> list[Group]:
    """Divide the commands into groups, keeping their order."""
    groups: dict[str, Group] = {}
    for index, command in enumerate(commands):
        prefix = _prefix(commands, index)
        groups.setdefault(prefix, Group(prefix, [])).commands.append(command)
    return list(groups.values())


def _prefix(commands: list[list[str]], index: int) -> str:
    alone = len(commands) == 1 or not takes_arguments(commands[index])
    return "" if alone else f"/evoros/node_{index}"


def takes_arguments(command: list[str]) -> bool:
    """Return True if a command starts a node, which accepts ROS arguments, not a launch file."""
    launches = os.path.basename(command[0]) == "ros2" and command[1:2] == ["launch"]
    return not launches and PLACEHOLDER not in " ".join(command)


def complete(commands: list[list[str]], topics: list[str]) -> list[list[str]]:
    """Return the commands with added arguments for parameters and topic names."""
    path = os.path.abspath(PARAMETERS)
    completed = []
    for index, command in enumerate(commands):
        filled = [part.replace(PLACEHOLDER, path) for part in command]
        if takes_arguments(command):
            filled += ["--ros-args", "--params-file", path]
            prefix = _prefix(commands, index)
            for topic in topics if prefix else ():
                filled += ["-r", f"{topic}:={prefix}{topic}"]
        completed.append(filled)
    return completed


def write_parameters(briefing: dict[str, Any]) -> None:
    """Write a parameter file for all nodes; raise a ValueError for a type that ROS 2 lacks."""
    parameters = {
        **{name: _checked(name, value) for name, value in briefing["parameters"].items()},
        "use_sim_time": True,
        "robot_description": briefing["ros"]["description"],
        "evoros": _describe_mission(briefing),
    }
    # JSON values are valid YAML.
    lines = [
        f"    {json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}\n"
        for name, value in parameters.items()
    ]
    with open(PARAMETERS, "w", encoding="utf-8") as file:
        file.write("/**:\n  ros__parameters:\n" + "".join(lines))


def _describe_mission(briefing: dict[str, Any]) -> dict[str, Any]:
    """Return the mission as parameters, without nested lists or mappings, which ROS 2 lacks."""
    sensors = briefing["sensors"]
    return {
        "seed": briefing["seed"],
        "sensors": [sensor["name"] for sensor in sensors],
        **{
            sensor["name"]: {key: _real(item) for key, item in sensor.items() if key != "name"}
            for sensor in sensors
        },
        "drive": {name: _real(value) for name, value in briefing["drive"].items()},
        "home": _real(briefing["home"]),
        "route": [float(value) for point in briefing["route"] for value in point],
        **{name: _real(briefing[name]) for name in ("acceptance_m", "time_limit_s", "period_s")},
    }


def _real(value: Any) -> Any:
    """Convert numbers to float, because ROS 2 distinguishes integers from floats."""
    if isinstance(value, list):
        return [_real(item) for item in value]
    return value if isinstance(value, str) else float(value)


def _checked(name: str, value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _checked(f"{name}.{key}", item) for key, item in value.items()}
    kinds = {type(item) for item in (value if isinstance(value, list) else [value])}
    if len(kinds) != 1 or not kinds <= {bool, int, float, str}:
        raise ValueError(
            f"controller.parameters.{name}: must be a number, a string, true or false, or a list "
            f"of one of these types, as ROS 2 demands, not {json.dumps(value)}; change the value"
        )
    return value


def set_environment(isolated: bool) -> object:
    """Isolate the nodes; return an object that must exist as long as the nodes do."""
    for name in ELSEWHERE:
        os.environ.pop(name, None)
    folder = os.getcwd()
    domain, claim = (0, None) if isolated else _free_domain()
    os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_HOME=folder, ROS_LOG_DIR=folder)
    old = os.environ.get("ROS_DISTRO") in BEFORE_RANGES
    if not isolated and os.environ.get("RMW_IMPLEMENTATION", FAST).startswith(FAST):
        for name in ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE"):
            os.environ[name] = PROFILE
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"  # limited by the profile
    elif old:
        os.environ["ROS_LOCALHOST_ONLY"] = "1"
    else:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    return claim


def _free_domain() -> tuple[int, object]:
    for shift in range(DOMAINS):
        domain = 1 + (os.getpid() + shift) % DOMAINS
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f"\0evoros-ros-domain-{domain}")
            for port in (0, 10, 11):  # ports of discovery and of the first participant
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
                    any_socket.bind(("", FIRST_PORT + PORTS_PER_DOMAIN * domain + port))
            return domain, claim
        except OSError:
            claim.close()
    raise OSError("all ROS 2 domains are in use")
