"""What a robot senses: maps and their quad-tree, map files, random floors."""

from sensing.maps import GridMap, map_folder, nearest_free, read_map, trace_folder
from sensing.movingai import (
    OPTIMUM_TOLERANCE,
    Scenario,
    read_movingai,
    read_scenarios,
    write_movingai,
    write_scenarios,
)
from sensing.random_maps import (
    FAMILIES,
    clustered,
    connected,
    corner_to_corner,
    instance,
    maze,
    rooms,
    uniform,
)
from sensing.ros_maps import read_ros_map, write_ros_map

__all__ = [
    "FAMILIES",
    "OPTIMUM_TOLERANCE",
    "GridMap",
    "Scenario",
    "clustered",
    "connected",
    "corner_to_corner",
    "instance",
    "map_folder",
    "maze",
    "nearest_free",
    "read_map",
    "read_movingai",
    "read_ros_map",
    "read_scenarios",
    "rooms",
    "trace_folder",
    "uniform",
    "write_movingai",
    "write_ros_map",
    "write_scenarios",
]
