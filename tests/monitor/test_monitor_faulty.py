"""Missions in which things go wrong on purpose: none raises, each repeats from its number."""

import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from anytime import AnytimeError, WorkClock
from anytime.__main__ import main
from anytime.faults import CLOCK, MODULE, Fault, FaultyClock, Schedule, read_schedule
from experiments import crossings
from experiments.benchmarks import faulty_missions
from experiments.benchmarks.faulty_missions import MISSION
from monitor import Decision, Ending, Monitor, Value
from monitor.calibration import measure_rhythm
from monitor.inter_frame import compiled_contracts
from monitor.policies import constant
from monitor.robots.faulty import LOG, ROBOT, FaultyRobot, faulty_program, kinds_of
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE, read_mission
from sensing.random_maps import corner_to_corner, uniform

PROGRAM = crossings.compiled()
STEADY = constant(dict(zip(PROGRAM.labels, (1.0, 1.0), strict=True)), 5.0)


def floor():
    import numpy as np

    free = uniform(40, 0.15, np.random.default_rng(5))
    start, goal = corner_to_corner(free)
    return Scene(free, start, goal)


def live(*faults, seed=0):
    schedule = Schedule(faults, seed)
    robot = GridRobot(floor(), MISSION.energy, FaultyClock(REFERENCE, schedule))
    faulty = FaultyRobot(robot, schedule)
    monitor = Monitor(faulty_program(PROGRAM, schedule, faulty), STEADY, "steady")
    return monitor.run(MISSION, faulty, listen=faulty.log)


@pytest.mark.parametrize("what", ["see", "find_path"])
@pytest.mark.parametrize("kind", MODULE)
def test_whatever_a_module_does_in_a_mission_the_goal_is_reached(what, kind):
    report = live(Fault(kind, what=what))
    assert report.ending is Ending.REACHED


@pytest.mark.parametrize("kind", {**ROBOT, **LOG, **CLOCK})
def test_whatever_goes_wrong_with_the_robot_the_mission_ends_in_the_closed_set(kind):
    what = "log" if kind in LOG else "clock" if kind in CLOCK else "robot"
    report = live(Fault(kind, begins=3.0, ends=20.0, what=what))
    ends = {"link": Ending.LINK_LOST}.get(kind, Ending.REACHED)
    assert report.ending is ends


def test_a_module_that_fails_three_times_is_asked_no_more():
    report = live(Fault("raises", what="see"))
    assert "see failed 3 times and is asked no more" in report.fault
    faults = [call for frame in report.frames for call in frame.calls if call.fault]
    assert len(faults) == 3


def test_a_robot_that_bumps_stands_where_it_was_and_plans_anew():
    report = live(Fault("bumps", begins=3.0, ends=9.0, what="robot", chance=0.3))
    walks = [frame.story["path"] for frame in report.frames]
    assert [walk[0] for walk in walks[1:]] == [walk[-1] for walk in walks[:-1]]
    for frame in report.frames:
        walked = frame.driven * frame.moments[-1].decision.speed
        assert frame.story["length"] <= walked + 1e-6 <= frame.story["length"] + 2**0.5 + 1e-6
    assert any(frame.interrupted for frame in report.frames)
    assert report.ending is Ending.REACHED
    assert "asked no more" not in report.fault


def test_motors_that_refuse_for_a_while_end_nobodys_service():
    report = live(Fault("refuses", begins=4.0, ends=12.0, what="robot"))
    assert report.ending is Ending.REACHED
    assert "asked no more" not in report.fault
    last = report.frames[-2]
    assert {call.label for call in last.calls} == set(PROGRAM.labels)


def test_motors_that_always_refuse_leave_it_to_avoidance():
    report = live(Fault("refuses", what="robot"))
    assert report.ending is Ending.REACHED
    assert "the robot refused 3 plans in a row" in report.fault


def test_the_ledger_of_a_mission_that_is_cut_in_a_frame_closes():
    report = live(Fault("link", begins=3.3, what="robot"))
    assert report.frames[-1].ended < report.seconds
    ledger = report.ledger
    assert ledger["drive"] + ledger["wait"] + ledger["job"] == pytest.approx(report.seconds)
    assert ledger["wait"] >= 0


def test_the_ledger_of_a_faulty_mission_closes():
    for number in range(30):
        outcome = faulty_missions.live(PROGRAM, faulty_missions.drawn(PROGRAM, number, 0))
        assert outcome.raised == ""
        assert outcome.ending != Ending.INTERNAL.value
        assert outcome.unclosed == 0


def test_a_faulty_mission_repeats_from_its_number():
    for number in range(6):
        lived = [
            faulty_missions.live(PROGRAM, faulty_missions.drawn(PROGRAM, number, 1))
            for _ in range(2)
        ]
        assert repr(lived[0].report) == repr(lived[1].report)


def test_a_log_that_cannot_be_written_is_told_and_the_mission_goes_on():
    report = live(Fault("full", what="log"))
    assert report.ending is Ending.REACHED
    assert "who listened failed" in report.fault


def test_a_policy_that_fails_leaves_the_last_resort():
    class Mad:
        def __call__(self, state):
            raise ZeroDivisionError("no idea")

    robot = GridRobot(floor(), MISSION.energy, WorkClock(REFERENCE))
    report = Monitor(PROGRAM, Mad(), "mad").run(MISSION, robot)
    assert report.ending is Ending.REACHED
    assert "policy mad failed" in report.fault


def test_a_policy_that_forgets_a_call_leaves_the_last_resort():
    robot = GridRobot(floor(), MISSION.energy, WorkClock(REFERENCE))
    report = Monitor(PROGRAM, constant({"look": 0.1}, 1.0), "short").run(MISSION, robot)
    assert report.ending is Ending.REACHED
    assert "the policy short failed: it gives no time to" in report.fault


@pytest.mark.parametrize(
    ("told", "wrong"),
    [
        ({"energy": math.nan}, "energy = nan"),
        ({"to_go": -5.0}, "to_go = -5.0"),
        ({"ending": "reached"}, "ending = 'reached'"),
    ],
)
def test_a_robot_that_tells_nonsense_of_itself_is_named(told, wrong, tmp_path):
    class Confused(GridRobot):
        def situation(self):
            return replace(super().situation(), **told)

    robot = Confused(floor(), MISSION.energy, WorkClock(REFERENCE))
    report = Monitor(PROGRAM, STEADY, "c").run(MISSION, robot)
    assert report.ending is Ending.INTERNAL
    assert report.fault.count(f"the robot's situation says {wrong}") == 1


def crossing(robot, policy=STEADY, mission=MISSION):
    return Monitor(PROGRAM, policy, "c").run(mission, robot)


def grid_robot(kind=GridRobot):
    return kind(floor(), MISSION.energy, WorkClock(REFERENCE))


@pytest.mark.parametrize("name", ["inputs", "begin", "complete", "situation"])
@pytest.mark.parametrize("way_out", [SystemExit, GeneratorExit])
def test_a_robot_that_exits_is_stopped_and_what_was_lived_is_told(name, way_out):
    stops = []

    class Exits(GridRobot):
        def stop(self):
            stops.append(self.clock.now())
            super().stop()

    robot = grid_robot(Exits)

    def exits(*anything):
        delattr(robot, name)
        raise way_out(3)

    setattr(robot, name, exits)
    report = crossing(robot)
    assert report.ending is Ending.INTERNAL
    assert way_out.__name__ in report.fault
    assert len(stops) == 1


def test_what_is_none_of_these_leaves_the_mission_once_the_robot_stands():
    class Foreign(BaseException):
        pass

    class Raises(GridRobot):
        stops = 0

        def complete(self):
            raise Foreign

        def stop(self):
            self.stops += 1

    robot = grid_robot(Raises)
    with pytest.raises(Foreign):
        crossing(robot)
    assert robot.stops == 1


def test_a_robot_that_cannot_be_stopped_is_told():
    class Rolls(GridRobot):
        def stop(self):
            raise OSError("no brakes")

    report = crossing(grid_robot(Rolls))
    assert report.ending is Ending.REACHED
    assert "the robot could not be stopped: OSError: no brakes" in report.fault


def test_energy_that_is_no_number_at_last_is_that_of_the_frames_and_named():
    class Forgets(GridRobot):
        stopped = False

        def stop(self):
            super().stop()
            self.stopped = True

        def situation(self):
            told = super().situation()
            return replace(told, energy=math.nan) if self.stopped else told

    report, sound = crossing(grid_robot(Forgets)), crossing(grid_robot())
    assert "energy = nan" in report.fault
    assert report.energy == pytest.approx(sum(frame.energy for frame in sound.frames))
    assert math.isfinite(report.net)


@pytest.mark.parametrize("length", [math.nan, math.inf, -1.0, None, "far"])
def test_a_story_of_impossible_lengths_is_named_in_missions_and_calibrations(length):
    class Boasts(GridRobot):
        def story(self):
            return {**super().story(), "length": length}

    assert "the robot's story says length = " in crossing(grid_robot(Boasts)).fault
    contracts = compiled_contracts(PROGRAM)
    with pytest.raises(AnytimeError, match=r"a mission of calibration ended: .* length = "):
        measure_rhythm(PROGRAM, MISSION, contracts, lambda: grid_robot(Boasts), seeds=[0])


def test_what_is_no_robot_mission_program_or_policy_is_refused_before_anything_moves():
    class Half:
        clock = WorkClock(REFERENCE)

        def inputs(self): ...

    with pytest.raises(AnytimeError, match="a Half, has no situation, begin"):
        crossing(Half())
    with pytest.raises(AnytimeError, match="the mission is a str"):
        crossing(grid_robot(), mission="office")
    with pytest.raises(AnytimeError, match="the program is a Constant"):
        Monitor(STEADY, PROGRAM)  # pyright: ignore[reportArgumentType]
    with pytest.raises(AnytimeError, match="the policy is 7"):
        Monitor(PROGRAM, 7)  # pyright: ignore[reportArgumentType]
    with pytest.raises(AnytimeError, match="seed is 'a'"):
        Monitor(PROGRAM, STEADY).run(MISSION, grid_robot(), seed="a")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("decision", "reason"),
    [
        (None, "it gives None, no Decision"),
        (Decision({"see": -1.0, "find_path": 1.0}, 1.0), "it gives -1.0 s to 'see'"),
        (Decision({"see": 1.0, "find_path": 1.0}, 0.0), "its speed is 0.0"),
        (Decision({"see": 1.0, "find_path": 1.0}, 1.0, why=None), "its reason is None"),  # pyright: ignore[reportArgumentType]
    ],
)
def test_a_decision_that_cannot_be_carried_out_is_named(decision, reason):
    assert reason in crossing(grid_robot(), policy=lambda state: decision).fault


def test_a_robot_that_never_moves_is_blocked_though_the_task_never_ends(monkeypatch):
    class Stuck(GridRobot):
        def begin(self, plan, speed): ...
        def avoid(self, speed): ...

    monkeypatch.setattr("monitor.monitoring.UNMOVED", 50)
    endless = replace(MISSION, value=Value("exponential", 100.0, 200.0))
    report = crossing(grid_robot(Stuck), mission=endless)
    assert report.ending is Ending.BLOCKED
    assert len(report.frames) == 50


def test_a_class_is_no_robot():
    monitor = Monitor(PROGRAM, STEADY, "c")
    with pytest.raises(AnytimeError, match="the robot is the class GridRobot"):
        monitor.run(MISSION, GridRobot)  # pyright: ignore[reportArgumentType]


def test_a_suspended_process_is_noticed_on_the_clock():
    report = live(Fault("suspended", 2.0, 300.0, what="clock"))
    assert report.seconds > 298.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_stops_the_robot_and_ends_the_mission(number):
    class Told(GridRobot):
        stopped = False

        def complete(self):
            os.kill(os.getpid(), number)
            super().complete()

        def stop(self):
            self.stopped = True

    robot = Told(floor(), MISSION.energy, WorkClock(REFERENCE))
    before = signal.getsignal(number)
    report = Monitor(PROGRAM, STEADY).run(MISSION, robot)
    assert report.ending is Ending.ABORTED
    assert robot.stopped
    assert signal.getsignal(number) is before


def test_a_second_ctrl_c_ends_the_program():
    class Stubborn(GridRobot):
        def complete(self):
            os.kill(os.getpid(), signal.SIGINT)

        def stop(self):
            os.kill(os.getpid(), signal.SIGINT)

    robot = Stubborn(floor(), MISSION.energy, WorkClock(REFERENCE))
    with pytest.raises(KeyboardInterrupt):
        Monitor(PROGRAM, STEADY).run(MISSION, robot)


# The file of faults


def faults_file(folder: Path, text: str) -> Path:
    path = folder / "faults.toml"
    path.write_text(text)
    return path


def test_faults_are_read_from_a_file(tmp_path):
    text = 'seed = 4\n[[fault]]\nwhat = "see"\nkind = "raises"\nfrom = 1\nto = 2.5\nchance = 0.5\n'
    schedule = read_schedule(faults_file(tmp_path, text), kinds_of(PROGRAM.program))
    assert schedule.faults == (Fault("raises", 1.0, 2.5, "see", 0.5),)
    assert schedule.seed == 4


@pytest.mark.parametrize(
    "text",
    [
        "fault = 3",
        '[[fault]]\nwhat = "nobody"\nkind = "raises"',
        '[[fault]]\nwhat = "see"\nkind = "sings"',
        '[[fault]]\nwhat = "see"\nkind = "raises"\nfrom = 3\nto = 2',
        '[[fault]]\nwhat = "see"\nkind = "raises"\nchance = 2.0',
        '[[fault]]\nwhat = "see"\nkind = "raises"\nnan = nan',
        '[[fault]]\nwhat = "clock"\nkind = "suspended"\nfrom = 3',
        "\x00",
    ],
)
def test_a_file_that_tells_of_no_fault_is_refused_in_one_line(tmp_path, text):
    with pytest.raises(AnytimeError) as refused:
        read_schedule(faults_file(tmp_path, text), kinds_of(PROGRAM.program))
    assert "\n" not in str(refused.value)


def test_a_mission_file_cannot_bring_faults_of_its_own(tmp_path):
    from experiments import shipped

    text = shipped.mission_path().read_text() + '\n[[fault]]\nwhat = "see"\nkind = "raises"\n'
    path = shipped.mission_path().parent / "office.pgm"
    mission = tmp_path / "mission.toml"
    mission.write_text(text)
    with pytest.raises(AnytimeError, match="fault"):
        read_mission(mission, map_path=path.parent.parent / "office.yaml")


def test_real_time_is_not_suspended_on_purpose(tmp_path, capsys):
    from experiments import shipped

    text = '[[fault]]\nwhat = "clock"\nkind = "suspended"\nfrom = 1\nto = 2\n'
    faults = ["--faults", str(faults_file(tmp_path, text)), "--clock", "wall"]
    assert main(["run", str(shipped.mission_path()), "--log", str(tmp_path), *faults]) == 2
    assert "take --clock work" in capsys.readouterr().err


def test_a_mission_that_is_killed_leaves_a_log_that_reads():
    from experiments.benchmarks import kills

    assert not any(corrupt or lost for corrupt, lost in kills.killed(2, 0))


def test_a_disk_that_fails_at_any_call_leaves_the_old_file_or_the_new():
    from experiments.benchmarks import kills

    assert not any(kills.failing())


def test_every_kind_of_file_that_is_spoilt_is_read_when_it_is_whole(tmp_path):
    from experiments.benchmarks.file_kinds import good_files_are_read

    kinds = list(good_files_are_read(tmp_path))
    assert {"profile", "schedule", "jsonl", "recording", "lesson", "map", "scen", "pgm"} < {*kinds}


def test_hostile_files_are_refused_in_one_line_and_run_no_code():
    script = (
        "import json; from experiments.benchmarks import malformed as m;"
        "c = m.read_all(300, 7); e = m.code_run(100, 8);"
        "print(json.dumps([c.tracebacks, c.bad_exit, c.first, e]))"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert ended.stdout.strip() == '[0, 0, "", []]', ended.stderr
