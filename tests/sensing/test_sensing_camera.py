"""The camera: exposure by exposure better, knows how good it is, repeats in every byte."""

import hashlib

import numpy as np
import pytest

from anytime.errors import AnytimeError
from sensing import Camera, clustered, rooms, uniform


def floors(kind, count):
    for seed in range(count):
        rng = np.random.default_rng(seed)
        if kind == "uniform":
            yield uniform(81, 0.2, rng), rng
        elif kind == "clustered":
            yield clustered(81, 0.2, rng), rng
        else:
            yield rooms(81, rng), rng


@pytest.fixture(scope="module")
def looks():
    """What is seen on three floors of each kind, [kind][floor] = (free, seen)."""
    camera = Camera()
    return {
        kind: [(free, list(camera.look(free, (40, 40), 32, rng))) for free, rng in floors(kind, 3)]
        for kind in ("uniform", "clustered", "rooms")
    }


def mean_scores(looks, kind, exposures):
    scores = [seen[exposures - 1].score(free) for free, seen in looks[kind]]
    return {
        name: float(np.mean([getattr(one, name) for one in scores]))
        for name in ("quality", "all_free", "false_free", "false_blocked")
    }


def test_nothing_is_seen_in_the_first_exposures(looks):
    for free, seen in looks["uniform"]:
        assert [sensed is None for sensed in seen] == [True] * 2 + [False] * 30
        assert free.shape == (81, 81)


def test_the_first_description_beats_calling_all_free(looks):
    scores = mean_scores(looks, "uniform", 3)
    assert scores["quality"] > scores["all_free"] + 0.05


@pytest.mark.parametrize("kind", ["uniform", "clustered", "rooms"])
def test_quality_rises_to_almost_all(looks, kind):
    ladder = [mean_scores(looks, kind, exposures)["quality"] for exposures in (3, 5, 8, 16, 32)]
    assert ladder == sorted(ladder)
    assert ladder[-1] >= 0.97
    assert ladder[0] < 0.93


@pytest.mark.parametrize("kind", ["uniform", "clustered", "rooms"])
def test_the_camera_knows_its_quality_without_the_truth(looks, kind):
    for exposures in (3, 4, 6, 8, 12, 16, 24, 32):
        told = np.mean([seen[exposures - 1].quality for _, seen in looks[kind]])
        assert told == pytest.approx(mean_scores(looks, kind, exposures)["quality"], abs=0.03)


def test_a_cell_is_right_as_often_as_its_confidence_says(looks):
    right, sure = [], []
    for kind in looks:
        for free, seen in looks[kind]:
            sensed = seen[4]
            counted = sensed.inside & ~sensed.unknown
            right.append((sensed.blocked != free[sensed.slices])[counted])
            sure.append(sensed.confidence[counted])
    right, sure = np.concatenate(right), np.concatenate(sure)
    for low, high in ((0.6, 0.7), (0.7, 0.8), (0.8, 0.9), (0.9, 0.97), (0.97, 1.0)):
        band = (sure >= low) & (sure < high)
        assert right[band].mean() == pytest.approx(sure[band].mean(), abs=0.07)


def test_a_darker_day_is_noticed_without_the_truth():
    free = uniform(81, 0.2, np.random.default_rng(0))
    for noise in (30.0, 60.0):
        seen = list(Camera(noise=noise, last=6).look(free, (40, 40), 32, np.random.default_rng(1)))
        assert seen[-1] is not None
        assert seen[-1].quality == pytest.approx(seen[-1].score(free).quality, abs=0.03)


@pytest.mark.parametrize("pixels", [3, 4])
def test_two_runs_give_the_same_bytes(pixels):
    free = uniform((30, 40), 0.2, np.random.default_rng(0))

    def digest():
        seen = Camera(pixels=pixels, last=6).look(free, (3, 35), 12, np.random.default_rng(2))
        content = b"".join(
            one.blocked.tobytes() + one.confidence.tobytes()
            for one in seen
            if one is not None and one.confidence is not None
        )
        return hashlib.sha256(content).hexdigest()

    assert digest() == digest()


def test_without_noise_all_is_right_at_once():
    free = rooms(60, np.random.default_rng(0))
    camera = Camera(noise=0.0, texture=0, defects=0.0, first=1, last=2)
    seen = list(camera.look(free, (30, 30), 20, np.random.default_rng(0)))
    assert [one.score(free).quality for one in seen if one is not None] == [1.0, 1.0]


def test_the_pattern_of_the_floor_stays_where_it_is():
    free = np.ones((20, 20), bool)
    camera = Camera()
    whole = camera.picture(free)
    part = camera.picture(free[5:15, 5:15], (5, 5))
    assert np.array_equal(part[1:-1, 1:-1], whole[16:44, 16:44])


def test_obstacles_are_darker_than_the_floor():
    free = np.ones((9, 9), bool)
    free[4, 4] = False
    picture = Camera(texture=0).picture(free)
    assert picture[13, 13] < picture[0, 0] == 132


def test_the_smallest_floor_can_be_looked_at():
    free = np.ones((1, 1), bool)
    seen = list(Camera(last=4).look(free, (0, 0), 5, np.random.default_rng(0)))
    assert seen[-1] is not None
    assert seen[-1].blocked.shape == (1, 1)


def test_a_view_may_be_wider_than_the_tile_of_noise():
    free = uniform(201, 0.2, np.random.default_rng(0))
    seen = list(Camera(last=4).look(free, (100, 100), 100, np.random.default_rng(0)))
    assert seen[-1] is not None
    assert seen[-1].quality == pytest.approx(seen[-1].score(free).quality, abs=0.03)


@pytest.mark.parametrize(
    ("numbers", "complaint"),
    [
        ({"pixels": 5}, "3 or 4"),
        ({"floor": 90}, "obstacle < floor"),
        ({"first": 9, "last": 8}, "first <= last"),
        ({"last": 1000}, "256"),
        ({"noise": float("nan")}, "noise"),
        ({"floor": 235, "obstacle": 211}, "at most 11.11"),
        ({"defects": 0.9}, "defects"),
        ({"doubt": 0.4}, "doubt"),
    ],
)
def test_a_camera_that_can_not_be_is_refused(numbers, complaint):
    with pytest.raises(AnytimeError, match=complaint):
        Camera(**numbers)
