"""What a robot senses: maps, their files and quad-tree, random floors, anytime vision, belief."""

from .belief import Belief, weight_of
from .camera import Camera
from .map_files import map_folder, read_map, trace_folder
from .maps import GridMap, nearest_free
from .movingai import (
    OPTIMUM_TOLERANCE,
    Scenario,
    read_movingai,
    read_scenarios,
    write_movingai,
    write_scenarios,
)
from .quadtree import QuadTree, quad_tree
from .random_maps import (
    FAMILIES,
    clustered,
    connected,
    corner_to_corner,
    instance,
    maze,
    rooms,
    uniform,
)
from .ros_maps import read_ros_map, write_ros_map
from .sensed_maps import Disc, MapScore, SensedMap, disc, score
from .vision import Device, Look, Sensor, Vision, looks, see, sense

__all__ = [
    "FAMILIES",
    "OPTIMUM_TOLERANCE",
    "Belief",
    "Camera",
    "Device",
    "Disc",
    "GridMap",
    "Look",
    "MapScore",
    "QuadTree",
    "Scenario",
    "SensedMap",
    "Sensor",
    "Vision",
    "clustered",
    "connected",
    "corner_to_corner",
    "disc",
    "instance",
    "looks",
    "map_folder",
    "maze",
    "nearest_free",
    "quad_tree",
    "read_map",
    "read_movingai",
    "read_ros_map",
    "read_scenarios",
    "rooms",
    "score",
    "see",
    "sense",
    "trace_folder",
    "uniform",
    "weight_of",
    "write_movingai",
    "write_ros_map",
    "write_scenarios",
]
