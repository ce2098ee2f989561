"""Mission files: what they say, and what they must not say."""

import pytest

from anytime import AnytimeError
from experiments import shipped
from monitor.robots.grid_missions import read_mission
from sensing.sensed_maps import disc

GOOD = shipped.mission_path().read_text()


def written(tmp_path, text: str):
    file = tmp_path / "m.toml"
    file.write_text(text.replace('"../office.yaml"', f'"{shipped.DATA / "office.yaml"}"'))
    return file


def test_the_shipped_mission_is_read():
    grid = read_mission(shipped.mission_path())
    assert grid.mission.name == "office"
    assert grid.scene.free[grid.scene.start]
    assert grid.scene.optimal > 250
    assert set(grid.mission.fixed) == {"see", "find_path", "speed"}


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("worth = 100.0", "wort = 100.0", "wort"),
        ('kind = "soft"', 'kind = "softer"', "value.kind"),
        ("start = [30, 8]", "start = [0, 0]", "inside an obstacle"),
        ("start = [30, 8]", "start = [9999, 8]", "off the map"),
        ("price = 0.2", 'price = "dear"', "price"),
        ("price = 0.2", "price = nan", "energy.price"),
        ('kind = "parametric"', 'kind = "crystal ball"', "vision.kind"),
        ("frame = 16.0", "frame = 99.0", "half the radius"),
        ("see = 0.25", "see = -1.0", "rate"),
        ("find_path = 0.001", "find_a_path = 0.001", "find_a_path"),
        ("speed = 7.499", "velocity = 7.499", "velocity"),
        ("speed = 7.499", "speed = nan", "fixed.speed is nan"),
        ("speed = 7.499", "speed = 750.0", "within speeds"),
        ("frame = 16.0", "frame = 16.0\ndensity = 1.0", "density is 1.0"),
        ('kind = "parametric"', 'kind = "camera"\nexposures = 2', "vision.exposures is 2"),
        ("[value]", "[value", "not TOML"),
        ("price = 0.2", f"price = {'9' * 5000}", "not TOML"),
        ("price = 0.2", f"price = {'[' * 5000}", "not TOML"),
        ("../office.yaml", "../nowhere.yaml", "nowhere.yaml"),
    ],
)
def test_a_mission_file_with_a_mistake_gets_one_line_that_names_it(tmp_path, old, new, told):
    file = tmp_path / "m.toml"
    text = GOOD.replace(old, new, 1)
    text = text.replace('"../office.yaml"', f'"{shipped.DATA / "office.yaml"}"')
    file.write_text(text)
    with pytest.raises(AnytimeError, match=told.replace("[", r"\[")) as caught:
        read_mission(file)
    assert "\n" not in str(caught.value)


def test_the_camera_can_take_the_place_of_the_papers_sensor(tmp_path):
    from sensing.camera import Camera

    text = GOOD.replace('kind = "parametric"', 'kind = "camera"')
    assert isinstance(read_mission(written(tmp_path, text)).scene.device, Camera)


def test_a_mission_has_one_goal_or_several_to_visit_in_the_best_order(tmp_path):
    several = GOOD.replace("goal = [148, 228]", "goals = [[148, 228], [98, 56]]")
    scene = read_mission(written(tmp_path, several)).scene
    assert scene.goals == ((148, 228), (98, 56))
    assert scene.optimal > read_mission(shipped.mission_path()).scene.optimal
    one = read_mission(written(tmp_path, several), goals=[(98, 56)]).scene
    assert one.goals == ((98, 56),)


@pytest.mark.parametrize(
    ("goals", "told"),
    [
        ("goal = [148, 228]\ngoals = [[98, 56]]", "it has a goal and goals; give one of them"),
        ("goals = []", "goals is empty; a mission has 1 to 8"),
        ("goals = [[98, 56], [98, 56]]", "2 goals, 1 of them different"),
        ("goals = [[98, 56], [0, 0]]", r"goal \(0, 0\) is inside an obstacle"),
    ],
)
def test_goals_that_cannot_be_visited_get_one_line(tmp_path, goals, told):
    with pytest.raises(AnytimeError, match=told):
        read_mission(written(tmp_path, GOOD.replace("goal = [148, 228]", goals)))


def test_news_is_read_and_a_time_that_is_none_is_refused(tmp_path):
    news = '[news]\nat = 20.0\nkind = "hard"\nworth = 100.0\nseconds = 60.0\n'
    mission = read_mission(written(tmp_path, GOOD + news)).mission
    assert (mission.known(0.0).value.kind, mission.known(30.0).value.kind) == ("soft", "hard")
    with pytest.raises(AnytimeError, match=r"news\.at is -1\.0; it must be a finite number > 0"):
        read_mission(written(tmp_path, GOOD + news.replace("20.0", "-1.0")))


def test_the_end_that_is_not_given_lies_far_off_in_the_same_part(tmp_path):
    (tmp_path / "two.map").write_text("type octile\nheight 2\nwidth 9\nmap\n...@.....\n...@.....\n")
    text = GOOD.replace('"../office.yaml"', '"two.map"').replace("frame = 16.0", "frame = 2.0")
    file = tmp_path / "m.toml"
    file.write_text(text.replace("start = [30, 8]\n", "").replace("goal = [148, 228]\n", ""))
    scene = read_mission(file).scene
    assert (scene.start, scene.goal) == ((0, 4), (1, 8))
    assert read_mission(file, start=(1, 2)).scene.goal == (0, 0)
    assert read_mission(file, goals=[(0, 4)]).scene.start == (1, 8)


def test_what_is_seen_of_a_small_floor_does_not_grow_with_the_radius(tmp_path):
    text = GOOD.replace("radius = 32", "radius = 1000000000000")
    assert read_mission(written(tmp_path, text)).scene.radius == 10**12
    seen = disc((2, 3), 10**30, (20, 30))
    assert seen.inside.all()
    assert seen.inside.shape == (20, 30)
