"""The office of the shipped missions; `python -m experiments.office` draws its map files.

A floor of 48 m x 32 m: team rooms along the windows, an open-plan office, a core of meeting rooms,
kitchen and stores, a laboratory, a lobby; two long corridors, two cross corridors, a passage
through the core and doors between rooms, so that many ways lead from one end to the other.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import ndimage

from sensing import GridMap, write_ros_map
from sensing.maps import BoolGrid, Cell

ROWS, COLUMNS, RESOLUTION = 160, 240, 0.2
START: Cell = (30, 8)
"""In the team room in the upper left corner."""
GOAL: Cell = (148, 228)
"""In the lobby in the lower right corner."""

_DOOR = 4
_CLUTTER_SEED = 1993

Area = tuple[int, int, int, int]  # top, left, bottom, right: the cells inside the walls, inclusive

TEAM_ROOMS = [
    (2, left, 36, right)
    for left, right in (
        (2, 25), (27, 49), (51, 81), (83, 105), (107, 129), (131, 165), (167, 189), (191, 213),
        (215, 237),
    )
]  # fmt: skip
OPEN_PLAN: Area = (47, 2, 104, 70)
MEETING_ROOMS: list[Area] = [(47, 82, 70, 107), (47, 136, 70, 157)]
KITCHEN: Area = (47, 109, 70, 134)
STORE: Area = (81, 82, 104, 103)
TOILETS: Area = (81, 105, 104, 125)
LIBRARY: Area = (81, 127, 104, 157)
QUIET_ROOMS: list[Area] = [(47, 169, 73, 202), (47, 204, 73, 237)]
LABORATORY: Area = (75, 169, 104, 237)
CONFERENCE: Area = (115, 2, 157, 58)
PROJECT_ROOMS: list[Area] = [(115, 60, 157, 84), (115, 86, 157, 110)]
ARCHIVE: Area = (115, 112, 157, 146)
WORKSHOP: Area = (115, 148, 157, 200)
LOBBY: Area = (115, 202, 157, 237)

ROOMS: list[Area] = [
    *TEAM_ROOMS, OPEN_PLAN, *MEETING_ROOMS, KITCHEN, STORE, TOILETS, LIBRARY, *QUIET_ROOMS,
    LABORATORY, CONFERENCE, *PROJECT_ROOMS, ARCHIVE, WORKSHOP, LOBBY,
]  # fmt: skip
CORE: Area = (46, 80, 105, 159)  # its outer walls are two cells thick
PASSAGE: Area = (73, 80, 78, 159)  # from one cross corridor to the other, through the core

DOORS_ACROSS: list[Cell] = [  # in walls that run from left to right: (row of the wall, left end)
    (37, 18), (37, 30), (37, 70), (37, 90), (37, 122), (37, 140), (37, 176), (37, 194), (37, 224),
    (46, 12), (46, 56), (105, 30), (105, 60), (46, 100), (46, 112), (46, 144),
    (71, 88), (71, 126), (71, 150), (79, 96), (79, 112), (79, 132),
    (105, 148), (46, 208), (46, 226), (74, 196), (74, 230), (105, 180), (105, 222),
    (114, 10), (114, 48), (114, 72), (114, 92), (114, 128), (114, 156), (114, 188), (114, 210),
    (114, 230),
]  # fmt: skip
DOORS_DOWN: list[Cell] = [  # in walls that run from top to bottom: (upper end, column of the wall)
    (8, 50), (26, 106), (10, 166), (24, 214), (52, 71), (74, 71), (96, 71), (58, 168), (84, 168),
    (98, 168), (64, 203), (50, 108), (140, 59), (124, 85), (148, 111), (120, 147), (150, 147),
    (134, 201),
]  # fmt: skip


def draw() -> GridMap:
    """Draw the office, the same in every run."""
    free = np.zeros((ROWS, COLUMNS), bool)
    for corridor in ((38, 2, 45, 237), (106, 2, 113, 237), (38, 72, 113, 79), (38, 160, 113, 167)):
        _clear(free, corridor)
    for room in ROOMS:
        _clear(free, room)
    _clear(free, PASSAGE)
    doorways = np.zeros_like(free)
    for row, left in DOORS_ACROSS:
        thick = _thickness(free[:, left], row)
        doorways[thick[0] : thick[1], left : left + _DOOR] = True
    for top, column in DOORS_DOWN:
        thick = _thickness(free[top], column)
        doorways[top : top + _DOOR, thick[0] : thick[1]] = True
    free |= doorways
    keep_clear = ndimage.binary_dilation(doorways, iterations=6).astype(bool)
    keep_clear[START[0] - 4 : START[0] + 5, START[1] - 4 : START[1] + 5] = True
    keep_clear[GOAL[0] - 4 : GOAL[0] + 5, GOAL[1] - 4 : GOAL[1] + 5] = True
    furniture = np.zeros_like(free)
    _furnish(furniture)
    _clutter(furniture, np.random.default_rng(_CLUTTER_SEED))
    free &= ~(furniture & ~keep_clear)
    begin = np.zeros_like(free)
    begin[START] = True
    reachable = ndimage.binary_propagation(begin, mask=free).astype(bool)
    return GridMap(reachable, resolution=RESOLUTION, name="office")


def _clear(free: BoolGrid, area: Area) -> None:
    top, left, bottom, right = area
    free[top : bottom + 1, left : right + 1] = True


def _thickness(line: BoolGrid, at: int) -> tuple[int, int]:
    """The run of wall around a place, so that a door goes right through it."""
    first = last = at
    while not line[first - 1]:
        first -= 1
    while not line[last + 1]:
        last += 1
    return first, last + 1


def _furnish(furniture: BoolGrid) -> None:
    for number, room in enumerate(TEAM_ROOMS):
        _team_room(furniture, room, number)
    _desk_islands(furniture, OPEN_PLAN)
    for room in MEETING_ROOMS:
        _table_with_chairs(furniture, room, margin=8)
    _rows_of_seats(furniture, CONFERENCE)
    top, left, bottom, right = KITCHEN
    _put(furniture, top, left + 14, 3, right - left - 13)  # counter
    _put(furniture, top + 3, right - 2, 8, 3)  # fridge and cupboards
    for row in (top + 8, top + 16):
        for column in (left + 3, left + 13):
            _put(furniture, row, column, 4, 4)
            _chairs_beside(furniture, (row, column, row + 3, column + 3))
    _shelves_down(furniture, STORE, aisle=4)
    _shelves_down(furniture, ARCHIVE, aisle=5)
    _cubicles(furniture, TOILETS)
    top, left, bottom, right = LIBRARY
    for column in range(left + 9, right - 4, 7):
        _put(furniture, top + 5, column, 9, 2)
    for column in (left + 3, left + 11):
        _put(furniture, bottom - 5, column, 3, 5)
    for room in QUIET_ROOMS:
        _desk_islands(furniture, room)
    _benches(furniture, LABORATORY)
    for number, room in enumerate(PROJECT_ROOMS, 1):
        _team_room(furniture, room, number)
        _table_with_chairs(furniture, (room[0] + 24, room[1], room[2], room[3]), margin=6)
    _benches(furniture, WORKSHOP)
    top, left, bottom, right = LOBBY
    _put(furniture, top + 10, left + 12, 3, 14)  # reception desk, an L
    _put(furniture, top + 10, left + 12, 10, 3)
    for column in (left + 3, left + 14):  # sofas around a low table
        _put(furniture, bottom - 2, column, 3, 8)
        _put(furniture, bottom - 8, column + 2, 3, 4)
    for row, column in ((38, 40), (38, 116), (38, 204), (45, 84), (45, 180), (106, 20), (106, 110),
                        (113, 36), (113, 140), (106, 204)):  # fmt: skip
        # plants and copiers along the walls of the corridors
        _put(furniture, row - (row in (45, 113)), column, 2, 3)


def _team_room(furniture: BoolGrid, area: Area, number: int) -> None:
    """Pairs of desks at the window and at the side walls, shelves between them."""
    top, left, bottom, right = area
    for column in range(left + 3, right - 8, 12):
        _put(furniture, top + 4, column, 4, 9)
        _put(furniture, top + 9, column + 2, 2, 2)
        _put(furniture, top + 1, column + 5, 2, 2)
    depth = min(bottom, top + 32)
    side = left if number % 2 else right - 3
    for row in range(top + 15, depth - 8, 11):
        _put(furniture, row, side, 8, 4)
        _put(furniture, row + 3, side + 5 if number % 2 else side - 3, 2, 2)
    shelf = right - 1 if number % 2 else left
    _put(furniture, top + 13, shelf, 12, 2)
    if right - left > 28:
        _put(furniture, top + 17, (left + right) // 2 - 4, 6, 9)
        _chairs_beside(furniture, (top + 17, (left + right) // 2 - 4, top + 22, left + 19))


def _desk_islands(furniture: BoolGrid, area: Area) -> None:
    """Four desks together, back to back, chairs on both sides, columns between the islands."""
    top, left, bottom, right = area
    for row in range(top + 5, bottom - 8, 15):
        for column in range(left + 5, right - 12, 19):
            _put(furniture, row, column, 7, 13)
            for chair in (column + 2, column + 9):
                _put(furniture, row - 2, chair, 2, 2)
                _put(furniture, row + 7, chair, 2, 2)
            if column + 19 < right - 12 and row + 15 < bottom - 8:
                _put(furniture, row + 10, column + 15, 2, 2)


def _table_with_chairs(furniture: BoolGrid, area: Area, margin: int) -> None:
    top, left, bottom, right = area
    table = (top + margin, left + margin, bottom - margin, right - margin)
    _put(furniture, table[0], table[1], table[2] - table[0] + 1, table[3] - table[1] + 1)
    _chairs_beside(furniture, table)


def _chairs_beside(furniture: BoolGrid, table: Area) -> None:
    top, left, bottom, right = table
    for column in range(left + 1, right - 1, 4):
        _put(furniture, top - 2, column, 2, 2)
        _put(furniture, bottom + 1, column, 2, 2)
    for row in range(top + 1, bottom - 1, 4):
        _put(furniture, row, left - 2, 2, 2)
        _put(furniture, row, right + 1, 2, 2)


def _rows_of_seats(furniture: BoolGrid, area: Area) -> None:
    """A lectern, and rows of seats with an aisle down the middle and at the sides."""
    top, left, bottom, right = area
    middle = (left + right) // 2
    _put(furniture, top + 9, middle - 8, 2, 4)
    for row in range(top + 16, bottom - 4, 5):
        _put(furniture, row, left + 6, 2, middle - left - 9)
        _put(furniture, row, middle + 4, 2, right - middle - 9)


def _shelves_down(furniture: BoolGrid, area: Area, aisle: int) -> None:
    top, left, bottom, right = area
    for column in range(left + aisle, right - 2, aisle + 3):
        middle = (top + bottom) // 2
        _put(furniture, top + 5, column, middle - top - 6, 3)
        _put(furniture, middle + 3, column, bottom - middle - 7, 3)


def _cubicles(furniture: BoolGrid, area: Area) -> None:
    """Cubicles along the far wall, open to the front, and a row of basins."""
    top, left, bottom, right = area
    for column in range(left + 4, right, 5):
        _put(furniture, bottom - 8, column, 9, 1)
    _put(furniture, top + 4, right - 2, 8, 3)
    _put(furniture, top + 9, left, 1, 12)


def _benches(furniture: BoolGrid, area: Area) -> None:
    """Long benches across the room, machines along the walls."""
    top, left, bottom, right = area
    for row in range(top + 6, bottom - 5, 9):
        for column in range(left + 7, right - 16, 24):
            _put(furniture, row, column, 4, 17)
            for stool in range(column + 2, column + 15, 5):
                _put(furniture, row + 4, stool, 1, 2)
    for row in range(top + 4, bottom - 6, 10):
        _put(furniture, row, right - 3, 6, 4)


def _clutter(furniture: BoolGrid, rng: np.random.Generator) -> None:
    """Bins, boxes, bags and plants: small things that stand about the rooms, away from the rest."""
    for top, left, bottom, right in ROOMS:
        for _ in range((bottom - top) * (right - left) // 60):
            height, width = (int(side) for side in rng.integers(1, 4, 2))
            row = int(rng.integers(top, bottom - height + 2))
            column = int(rng.integers(left, right - width + 2))
            if not furniture[row - 2 : row + height + 2, column - 2 : column + width + 2].any():
                _put(furniture, row, column, height, width)


def _put(furniture: BoolGrid, row: int, column: int, height: int, width: int) -> None:
    furniture[row : row + height, column : column + width] = True


def main() -> None:
    """Write the map files that ship with the project."""
    write_ros_map(draw(), Path(__file__).parent / "data" / "office.yaml")


if __name__ == "__main__":
    main()
