"""The command line: what it prints, what it writes, and one line for what it cannot do."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from anytime.__main__ import main
from anytime.files import checksum, read_json
from compiler import compile
from experiments import shipped
from monitor.robots.navigation import navigate
from sensing import map_folder

OFFICE = str(shipped.mission_path())


def call(capsys, *arguments: str) -> tuple[int, str, str]:
    try:
        code = main(arguments)
    except SystemExit as left:
        code = int(left.code or 0)
    out, err = capsys.readouterr()
    return code, out, err


def test_a_mission_is_run_from_its_file_and_leaves_a_log_and_a_page(capsys, tmp_path):
    log = tmp_path / "run"
    code, out, err = call(
        capsys, "run", OFFICE, "--policy", "fixed", "--json", "--log", str(log), "--seed", "4"
    )
    assert code == 0, err
    told = json.loads(out)
    assert told["ending"] == "reached"
    ledger = told["ledger"]
    assert ledger["drive"] + ledger["wait"] + ledger["job"] == pytest.approx(told["seconds"])
    assert (log / "mission.jsonl").exists()
    assert "<html" in (log / "mission.html").read_text()
    code, out, _ = call(capsys, "replay", str(log / "mission.jsonl"), "-o", str(log / "again.html"))
    assert code == 0
    assert (log / "again.html").read_text() == (log / "mission.html").read_text()
    code, out, _ = call(capsys, "plot", str(log / "mission.jsonl"), "-o", str(tmp_path))
    assert code == 0
    assert Path(out.strip()).read_bytes().startswith(b"\x89PNG")


def test_the_demo_prints_its_figures_as_one_object(capsys, tmp_path):
    code, out, _ = call(capsys, "demo", "--seeds", "4", "--json", "-o", str(tmp_path))
    assert code == 0
    told = json.loads(out)
    value = told["figures"]["value"]
    assert {"monitored", "min", "max", "fixed", "promised", "margin", "margin_low"} <= set(value)
    assert abs(told["figures"]["gap"]["promised"]) < 0.25  # four seeds are few
    assert told["settings"]["seeds"] == 4
    page = (tmp_path / "report.html").read_text()
    assert page.count("<html") == 1


def test_profile_compile_explain_advise_plot_follow_one_another(capsys, tmp_path):
    script = tmp_path / "lab.py"
    script.write_text(
        "import anytime, compiler\n"
        "from types import SimpleNamespace as Problem\n"
        "@anytime.module(quality=lambda x, problem: 1 - abs(x - problem.truth))\n"
        "def see(image):\n"
        "    guess = 0.0\n"
        "    for _ in range(20):\n"
        "        guess += 0.3 * (image - guess)\n"
        "        yield guess\n"
        "@anytime.module(cost=lambda x, problem: 1 + abs(x - problem.truth))\n"
        "def act(seen):\n"
        "    for share in 0.5, 0.8, 1.0:\n"
        "        yield share * seen\n"
        "@compiler.program\n"
        "def both(image):\n"
        "    return act(see(image))\n"
        "def problems(rng):\n"
        "    while True:\n"
        "        truth = rng.random()\n"
        "        yield Problem(image=truth, truth=truth)\n"
    )
    library, schedule = tmp_path / "profiles", tmp_path / "both.schedule"
    asked = (f"{script}:both", "--problems", f"{script}:problems", "--library", str(library))
    code, _, err = call(capsys, "profile", *asked, "--runs", "5", "--seconds", "0.05")
    assert code == 0, err
    code, out, _ = call(capsys, "library", "--library", str(library))
    assert "see" in out
    assert "act" in out
    code, _, err = call(
        capsys, "compile", f"{script}:both", "--library", str(library), "-o", str(schedule)
    )
    assert code == 0, err
    code, out, err = call(capsys, "explain", str(schedule), "--seconds", "1", "--json")
    assert code == 0, err
    assert set(json.loads(out)["shares"]) == {"see", "act"}
    code, out, _ = call(capsys, "advise", str(schedule), "--seconds", "1")
    assert "2× faster" in out
    code, out, _ = call(
        capsys, "plot", str(schedule), str(library / "act.profile"), "-o", str(tmp_path)
    )
    assert code == 0
    assert len(out.split()) == 2


def lying_map(tmp_path: Path) -> list[str]:
    file = tmp_path / "lie.map"
    file.write_text("type octile\nheight 9\nwidth 2\nmap\n..\n")
    return ["run", OFFICE, "--map", str(file), "--log", str(tmp_path / "run")]


def wrong_key(tmp_path: Path) -> list[str]:
    file = tmp_path / "m.toml"
    file.write_text(shipped.mission_path().read_text().replace("worth =", "wort =", 1))
    return ["run", str(file), "--log", str(tmp_path / "run")]


def walled_in(tmp_path: Path) -> list[str]:
    return ["run", OFFICE, "--start", "0,0", "--log", str(tmp_path / "run")]


def damaged_profile(tmp_path: Path, old: str, new: str) -> list[str]:
    folder = tmp_path / "library"
    folder.mkdir()
    for file in (shipped.DATA / "profiles").iterdir():
        (folder / file.name).write_text(file.read_text())
    see = folder / "see.profile"
    see.write_text(see.read_text().replace(old, new, 1))
    return ["run", OFFICE, "--library", str(folder), "--log", str(tmp_path / "run")]


def empty_profile(tmp_path: Path) -> list[str]:
    arguments = damaged_profile(tmp_path, "nothing", "nothing")
    see = tmp_path / "library" / "see.profile"
    content = read_json(see)
    content["runs"] = []
    del content["checksum"]
    content["checksum"] = checksum(content)
    see.write_text(json.dumps(content))
    return arguments


def too_little_time(tmp_path: Path) -> list[str]:
    file = tmp_path / "navigate.schedule"
    compile(navigate, shipped.profiles()).save(file)
    return ["explain", str(file), "--seconds", "0.000001"]


BAD = {
    "an empty profile": (empty_profile, "no recorded run"),
    "a budget below the least": (too_little_time, "below the least budget"),
    "a map whose header lies": (lying_map, "lie.map"),
    "a wrong key": (wrong_key, "wort"),
    "a start inside a wall": (walled_in, "inside an obstacle"),
    "a profile with NaN": (lambda p: damaged_profile(p, "0.5", "NaN"), "NaN"),
    "an edited profile": (lambda p: damaged_profile(p, "0.5", "0.25"), "checksum"),
    "an unknown policy": (lambda p: ["run", OFFICE, "--policy", "best"], "no policy"),
    "a missing mission": (lambda p: ["run", str(p / "none.toml")], "no such mission"),
    "an unknown module": (lambda p: ["profile", "telepathy"], "telepathy"),
    "a missing library": (lambda p: ["library", "--library", str(p / "x")], "no such folder"),
    "a missing schedule": (lambda p: ["explain", str(p / "x"), "--seconds", "1"], "no such file"),
    "a time that is none": (lambda p: ["explain", "x", "--seconds", "nan"], "finite"),
    "a scenario without a map": (lambda p: ["run", OFFICE, "--scenario", "1"], "--map"),
    "one seed": (lambda p: ["demo", "--seeds", "1"], "at least 2"),
    "an unknown command": (lambda p: ["dance"], "dance"),
    "something that cannot be drawn": (lambda p: ["plot", OFFICE, "-o", str(p)], ".toml"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_input_gets_exit_2_and_one_line_and_nothing_half_written(capsys, tmp_path, what):
    make, told = BAD[what]
    arguments = make(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    code, out, err = call(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert told in err
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err
    assert sorted(tmp_path.rglob("*")) == before


def test_a_users_own_monitor_py_is_named_in_one_line(tmp_path):
    (tmp_path / "monitor.py").write_text("")
    found = subprocess.run(
        [sys.executable, "-m", "anytime", "--help"], cwd=tmp_path, capture_output=True, text=True
    )
    assert found.returncode == 2
    assert "monitor.py" in found.stderr
    assert len(found.stderr.strip().splitlines()) == 1


def test_help_imports_nothing_heavy():
    script = (
        "import sys; from anytime.__main__ import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = ('numpy', 'numba', 'cv2', 'scipy', 'matplotlib', 'msgspec', 'tqdm')\n"
        "print([m for m in heavy if m in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert found.stdout.strip().endswith("[]"), found.stdout


MAPS = ("ros/tb3_sandbox.yaml", "ros/lse_arena.yaml", "dao/arena.map", "room/8room_000.map")
MORE = [
    pytest.param(name, marks=pytest.mark.slow)
    for name in (
        "ros/depot.yaml",
        "ros/turtlebot3_world_map.yaml",
        "dao/den312d.map",
        "street/Berlin_1_256.map",
        "bg512/AR0011SR.map",
    )
]


@pytest.mark.parametrize("name", [*MAPS, *MORE])
def test_missions_on_public_maps_end_with_an_ending_and_a_page(capsys, tmp_path, name):
    folder = map_folder()
    if folder is None:
        pytest.skip("the public maps are not here; set ANYTIME_MAPS")
    chosen = [] if name.startswith("ros/") else ["--scenario", "100"]
    floor = ["--map", str(folder / name), "--log", str(tmp_path)]
    code, out, err = call(capsys, "run", OFFICE, *floor, *chosen, "--policy", "paper", "--json")
    assert code in (0, 1), err
    assert json.loads(out)["ending"] in ("reached", "deadline")
    assert (tmp_path / "mission.html").exists()
