"""Scene files: what they say, what they must not say, and the scenes that ship."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError
from experiments.shipped import DATA
from monitor.robots.nao_noise import NOISELESS, Noise
from monitor.robots.nao_scenes import Goal, read_scene
from monitor.robots.nao_world import Obstacle
from monitor.robots.simulated_nao import SimulatedNao

SCENES = DATA / "scenes"
SHIPPED = sorted(path.stem for path in SCENES.glob("*.toml"))
GOOD = (SCENES / "sitting.toml").read_text()


def test_the_scenes_of_the_paper_ship():
    assert SHIPPED == [
        "appearing",
        "fall",
        "hidden_second",
        "moving_target",
        "removed_early",
        "removed_late",
        "sitting",
    ]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_scene_can_be_lived_in_with_and_without_noise(name):
    scene = read_scene(SCENES / f"{name}.toml")
    assert scene.name == name
    assert scene.posture == "Sit"
    assert scene.noise == Noise()
    assert read_scene(SCENES / f"{name}.toml", noise=False).noise == NOISELESS
    nao = SimulatedNao(scene)
    action = nao.posture("Stand")
    nao.wait(9.0)
    assert action.poll() is not None
    assert nao.read().posture == "Stand"


def test_the_first_figure_of_the_paper_is_read():
    scene = read_scene(SCENES / "sitting.toml", seed=5)
    assert scene.seed == 5
    assert scene.goal == Goal((1.0, 0.0))
    assert scene.obstacles == (Obstacle((0.5, 0.0), radius=0.1),)
    assert scene.sonars.version == "V4"
    assert scene.sonars.half_angle == pytest.approx(math.pi / 6)


@given(
    st.tuples(*[st.floats(-3, 3)] * 2), st.tuples(*[st.floats(-0.03, 0.03)] * 2), st.floats(0, 9)
)
def test_a_goal_is_met_where_it_will_be_when_one_can_be_there(at, velocity, delay):
    goal, speed = Goal(at, velocity), 0.1
    x, y = goal.meeting_point((0.0, 0.0), 2.0, speed=speed, delay=delay)
    takes = delay + math.dist((0.0, 0.0), (x, y)) / speed
    if takes < 60.0:
        assert (x, y) == pytest.approx(goal.place(2.0 + takes), abs=1e-3)


def test_a_goal_that_is_too_fast_to_be_met_is_followed_a_minute_ahead():
    goal = Goal((1.0, 0.0), (1.0, 0.0))
    assert goal.meeting_point((0.0, 0.0), 2.0, speed=0.1, delay=1.0) == goal.place(62.0)


def test_a_moving_goal_moves():
    nao = SimulatedNao(read_scene(SCENES / "moving_target.toml"))
    nao.wait(6.0)
    assert nao.goal_in_world == pytest.approx((1.3, 0.0))


def test_in_the_scene_of_the_fall_who_walks_straight_on_falls():
    scene = read_scene(SCENES / "fall.toml")
    for seed in range(5):
        nao = SimulatedNao(scene if seed else scene.noiseless())
        nao.posture("Stand")
        nao.wait(8.2)
        nao.walk(1.0, 0.0, 0.0)
        nao.wait(12.0)
        assert nao.falls == 1


def test_one_source_of_noise_can_be_switched_off_alone(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text(GOOD.replace("odometry = true", "odometry = false"))
    noise = read_scene(file).noise
    assert noise.odometry == NOISELESS.odometry
    assert noise.execution == Noise().execution
    file.write_text("noise = false\n[goal]\nat = [1, 0]")
    assert read_scene(file).noise == NOISELESS


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("seed = 1", "sed = 1", "sed"),
        ("seed = 1", 'seed = "one"', "seed"),
        ("[goal]\nat = [1.0, 0.0]", "", "goal"),
        ("[goal]", "[goal", "not TOML"),
        ("seed = 1", f"seed = {'9' * 5000}", "not TOML"),
        ("seed = 1", f"seed = {'[' * 5000}", "not TOML"),
        ("at = [1.0, 0.0]", "at = [nan, 0.0]", "finite"),
        ("at = [1.0, 0.0]", "at = [1e6, 0.0]", "50 m from the origin"),
        ("at = [1.0, 0.0]", "at = [1.0, 0.0]\nvelocity = [1e308, 0.0]", "goal's velocity.*1 m/s"),
        ("at = [1.0, 0.0]", "at = [1.0, 0.0, 0.0]", "goal.at"),
        ("at = [0.0, 0.0, 0.0]", "at = [inf, 0.0, 0.0]", "finite"),
        ("at = [0.0, 0.0, 0.0]", "at = [0.3, 0.0, 0.0]", "obstacle 1 stands where"),
        ('posture = "Sit"', 'posture = "Headstand"', "Headstand.*StandZero"),
        ('posture = "Sit"', "secure = -1.0", "secure"),
        ('version = "V4"', 'version = "V9"', "V9.*V4, V5, V6"),
        ("half_angle_degrees = 30.0", "half_angle_degrees = 90.0", "half angle"),
        ("half_angle_degrees = 30.0", "half_angle_degrees = nan", "half angle"),
        ("falls = true", "fall = true", "fall"),
        ("falls = true", 'falls = "often"', "falls"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 51.0, 0.1]", "50 m from the origin"),
        ("disc = [0.5, 0.0, 0.1]", "", "obstacle 1.*disc = .* or box"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 0, 0.1]\nbox = [1, 1, 1, 1]", "either"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 0.0, -0.1]", "obstacle 1.*lengths"),
        ("disc = [0.5, 0.0, 0.1]", "box = [0.5, 0.0, 0.1, inf]", "obstacle 1.*lengths"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 0.0, 0.1]\nfrom = 3\nuntil = 2", "vanishes"),
        ("disc = [0.5, 0.0, 0.1]", "box = [0.6, 30.0, 1e300, 1.0]", "at most 10000 m"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 0.0, 0.1]\nfrom = nan", "appears"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 0.0, 0.1]\nvelocity = [9, 0]", "1 m/s"),
        ("disc = [0.5, 0.0, 0.1]", "disc = [0.5, 0.0, 0.1]\nspeed = 1", "speed"),
    ],
)
def test_a_scene_file_with_a_mistake_gets_one_line_that_names_it(tmp_path, old, new, told):
    assert old in GOOD
    file = tmp_path / "s.toml"
    file.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(AnytimeError, match=told) as caught:
        read_scene(file)
    assert "\n" not in str(caught.value)
    assert str(file) in str(caught.value)


def test_a_scene_that_is_no_file_is_told(tmp_path):
    with pytest.raises(AnytimeError, match="no such scene file"):
        read_scene(tmp_path / "nowhere.toml")
    with pytest.raises(AnytimeError, match="is a folder"):
        read_scene(tmp_path)
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(AnytimeError, match="not TOML"):
        read_scene(tmp_path / "b.toml")


@given(st.data())
def test_whatever_is_cut_out_of_a_scene_file_it_is_read_or_refused_in_one_line(data):
    first = data.draw(st.integers(0, len(GOOD)))
    last = data.draw(st.integers(first, len(GOOD)))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "s.toml"
        file.write_text(GOOD[:first] + GOOD[last:])
        assert "\n" not in complaint(file)


def complaint(file):
    try:
        read_scene(file)
    except AnytimeError as error:
        return str(error)
    return ""
