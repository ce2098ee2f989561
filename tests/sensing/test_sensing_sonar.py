"""The sonars: the nearest thing in the cone, whatever its bearing, and never a nearer one."""

import math

import numpy as np
import pymunk
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError
from sensing.sonar import MOUNTS, VERSIONS, Cone, Sonars, Surroundings

HALF = math.radians(30)
AHEAD = Cone(0.0, 0.0, 0.0, HALF)
NOBODY = Surroundings()


def square(x, y, side, turned):
    cos, sin = math.cos(turned) * side / 2, math.sin(turned) * side / 2
    corners = [
        (x + u * cos - v * sin, y + u * sin + v * cos)
        for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ]
    return [(*one, *other) for one, other in zip(corners, corners[1:] + corners[:1], strict=True)]


numbers = st.floats(-2, 2)
circles = st.tuples(numbers, numbers, st.floats(0.01, 0.5))
walls = st.tuples(numbers, numbers, numbers, numbers)
surroundings = st.builds(
    Surroundings, st.lists(circles, max_size=4).map(tuple), st.lists(walls, max_size=4).map(tuple)
)
cones = st.builds(Cone, numbers, numbers, st.floats(-7, 7), st.floats(0.05, math.pi / 4))


def on(cone, around, rays=401):
    """Nearest hits of a dense fan of rays, found by a geometry of its own."""
    nearest = math.inf
    for bearing in cone.bearing + np.linspace(-cone.half_angle, cone.half_angle, rays):
        ux, uy = math.cos(bearing), math.sin(bearing)
        for x, y, radius in around.circles:
            right, up = x - cone.x, y - cone.y
            along, across = right * ux + up * uy, right * uy - up * ux
            if abs(across) <= radius and along + math.sqrt(radius**2 - across**2) >= 0:
                nearest = min(nearest, max(0.0, along - math.sqrt(radius**2 - across**2)))
        for x0, y0, x1, y1 in around.walls:
            right, up = x1 - x0, y1 - y0
            turn = ux * up - uy * right
            if abs(turn) > 1e-12:
                far = ((x0 - cone.x) * up - (y0 - cone.y) * right) / turn
                part = ((x0 - cone.x) * uy - (y0 - cone.y) * ux) / turn
                if far >= 0 and 0 <= part <= 1:
                    nearest = min(nearest, far)
    return nearest


@settings(max_examples=60, deadline=None)
@given(cones, surroundings)
def test_no_ray_in_the_cone_ends_nearer_than_what_is_reported(cone, around):
    assert cone.nearest(around) <= on(cone, around, 41) + 1e-6


@settings(max_examples=100)
@given(cones, surroundings, st.floats(-math.pi, math.pi), numbers, numbers)
def test_only_what_is_seen_from_the_robot_counts(cone, around, turn, right, up):
    cos, sin = math.cos(turn), math.sin(turn)

    def moved(x, y):
        return cos * x - sin * y + right, sin * x + cos * y + up

    elsewhere = Surroundings(
        tuple((*moved(x, y), radius) for x, y, radius in around.circles),
        tuple((*moved(x0, y0), *moved(x1, y1)) for x0, y0, x1, y1 in around.walls),
    )
    same = Cone(*moved(cone.x, cone.y), cone.bearing + turn, cone.half_angle + 1e-7)
    assert same.nearest(elsewhere) <= cone.nearest(around) + 1e-5


def test_it_agrees_with_the_rays_of_a_physics_engine_within_a_centimetre():
    rng = np.random.default_rng(4)
    compared = 0
    for _ in range(60):
        space = pymunk.Space()
        around, boxes = [], []
        for _ in range(4):
            x, y, size, turned = rng.uniform([-1.5, -1.5, 0.05, 0], [1.5, 1.5, 0.4, 3])
            if math.hypot(x, y) < size + 0.2:
                continue
            body = pymunk.Body(body_type=pymunk.Body.STATIC)
            body.position = x, y
            if rng.random() < 0.5:
                around.append((x, y, size))
                space.add(body, pymunk.Circle(body, size))
            else:
                boxes += square(x, y, size, turned)
                body.angle = turned
                space.add(body, pymunk.Poly.create_box(body, (size, size)))
        cone = Cone(0.0, 0.0, rng.uniform(-3, 3), HALF)
        hits = []
        for bearing in cone.bearing + np.linspace(-HALF, HALF, 481):
            end = 3 * math.cos(bearing), 3 * math.sin(bearing)
            hit = space.segment_query_first((0, 0), end, 0.0, pymunk.ShapeFilter())
            if hit is not None:
                hits.append(3 * hit.alpha)
        exact = cone.nearest(Surroundings(tuple(around), tuple(boxes)))
        assert exact == pytest.approx(min(hits, default=math.inf), abs=0.01)
        compared += bool(hits)
    assert compared > 30


def test_a_thin_pole_is_not_missed():
    for bearing in np.linspace(-0.5, 0.5, 97):
        pole = (2 * math.cos(bearing), 2 * math.sin(bearing), 0.01)
        assert AHEAD.nearest(Surroundings((pole,))) == pytest.approx(1.99, abs=1e-6)


def test_what_only_reaches_into_the_cone_is_heard_where_it_does():
    around = Surroundings(((1.0, 1.0, 0.5),))
    assert AHEAD.nearest(around) == pytest.approx(on(AHEAD, around), abs=1e-3)
    assert AHEAD.nearest(Surroundings(((1.0, 1.0, 0.3),))) == math.inf
    assert AHEAD.nearest(Surroundings(((-0.5, 0.0, 0.3),))) == math.inf
    assert AHEAD.nearest(Surroundings(((0.1, 0.0, 0.3),))) == 0.0


def test_a_wall_is_heard_at_its_nearest_point_in_the_cone():
    assert AHEAD.nearest(Surroundings(walls=((1, -5, 1, 5),))) == pytest.approx(1.0)
    beside = Surroundings(walls=((-5, 0.5, 5, 0.5),))
    assert AHEAD.nearest(beside) == pytest.approx(0.5 / math.sin(HALF))
    assert AHEAD.nearest(Surroundings(walls=((-1, -5, -1, 5),))) == math.inf


def test_left_and_right_are_told_apart():
    sonars = Sonars()
    left, right = sonars.distances((0.0, 0.0, 0.0), Surroundings(((0.5, 0.5, 0.1),)))
    assert left < 0.6
    assert right == math.inf
    assert [mount[2] for mount in MOUNTS] == [math.radians(25), -math.radians(25)]


@pytest.mark.parametrize("degrees", [15, 30])
def test_narrow_cones_leave_a_gap_ahead_and_wide_ones_do_not(degrees):
    far = Surroundings(((2.0, 0.0, 0.05),))
    heard = Sonars(half_angle=math.radians(degrees)).distances((0.0, 0.0, 0.0), far)
    assert (min(heard) < math.inf) == (degrees == 30)


@given(st.sampled_from(sorted(VERSIONS)), st.floats(0, 4))
def test_without_noise_nothing_is_reported_nearer_than_it_is(version, distance):
    sonars = Sonars(version)
    told, same = sonars.hear((distance, distance))
    ranger = sonars.ranger
    assert told == same
    assert told >= min(distance, ranger.estimated) - 1e-9
    if distance > ranger.estimated:
        assert told == math.inf
    elif distance > ranger.nearest:
        assert told - distance <= ranger.resolution + 1e-9
    else:
        assert told == ranger.nearest


def test_noise_is_as_large_as_it_should_be_and_some_echoes_get_lost():
    rng = np.random.default_rng(0)
    told = np.array([Sonars("V4").hear((1.0, math.inf), rng) for _ in range(4000)])
    heard = told[:, 0][np.isfinite(told[:, 0])]
    assert np.isinf(told[:, 1]).all()
    assert 1 - len(heard) / 4000 == pytest.approx(0.02, abs=0.01)
    assert heard.std() == pytest.approx(0.0104, abs=0.001)
    far = np.array([Sonars("V6").hear((2.0, 2.0), rng)[0] for _ in range(2000)])
    assert far[np.isfinite(far)].std() == pytest.approx(0.2, abs=0.03)


def test_draws_do_not_depend_on_what_is_there():
    one, other = np.random.default_rng(1), np.random.default_rng(1)
    Sonars().hear((1.0, 0.1), one)
    Sonars().hear((math.inf, math.inf), other)
    assert one.random() == other.random()


@pytest.mark.parametrize(
    ("bad", "told"),
    [({"version": "V2"}, "V4, V5, V6"), ({"half_angle": 1.0}, "half angle")],
)
def test_sonars_that_there_are_not_are_refused(bad, told):
    with pytest.raises(AnytimeError, match=told):
        Sonars(**bad)


def test_an_empty_floor_is_silent():
    assert AHEAD.nearest(NOBODY) == math.inf
    assert Sonars().hear(Sonars().distances((0, 0, 0), NOBODY)) == (math.inf, math.inf)


@given(cones, st.floats(0.1, 3.0), st.floats(-1, 1), st.floats(0, 1))
def test_what_is_near_in_a_cone_is_within_its_bounds_and_they_are_no_wider(cone, reach, off, far):
    west, east, south, north = cone.bounds(reach)
    bearing = cone.bearing + off * cone.half_angle
    x = cone.x + far * reach * math.cos(bearing)
    y = cone.y + far * reach * math.sin(bearing)
    assert west - 1e-9 <= x <= east + 1e-9
    assert south - 1e-9 <= y <= north + 1e-9
    across = cone.bearing + np.linspace(-1, 1, 2001) * cone.half_angle
    for low, high, at, ways in ((west, east, cone.x, np.cos), (south, north, cone.y, np.sin)):
        places = [at, *(at + reach * ways(across))]
        assert min(places) - low < 1e-3
        assert high - max(places) < 1e-3
