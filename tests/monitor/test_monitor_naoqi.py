"""A NAO over NAOqi: to the bit the simulated one in lock-step, and safe when something goes wrong.

Real libqi on 127.0.0.1; servers and clients are processes of their own.
"""

import contextlib
import json
import math
import queue
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError, WallClock, WorkClock
from anytime.machines import Machine
from experiments.benchmarks import hostile_clients, link_faults
from experiments.benchmarks.nao_failures import FAILURES
from experiments.benchmarks.nao_lockstep import COLLIDING, FREE, identical, observed
from experiments.benchmarks.nao_rig import Rig
from experiments.nao_serving import ServedNao
from monitor.robots import naoqi_link
from monitor.robots.nao_addresses import nao_body
from monitor.robots.nao_body import LYING, LinkLostError, NaoBody, Outcome
from monitor.robots.nao_faults import KINDS, Fault, Faulty, read_fault
from monitor.robots.nao_noise import NOISELESS
from monitor.robots.nao_odometry import compose, inverse
from monitor.robots.nao_recording import Recorder, Replay
from monitor.robots.nao_scenes import Scene, read_scene
from monitor.robots.nao_world import Obstacle
from monitor.robots.naoqi import NaoqiBody
from monitor.robots.naoqi_actions import Way
from monitor.robots.naoqi_link import AuthenticatorFactory, password
from monitor.robots.naoqi_names import FALLEN, NO_ECHO, SONARS
from monitor.robots.naoqi_server import Listening, Memory, Motion, Postures, SimClock, Watching
from monitor.robots.naoqi_watch import LIMIT, Watch
from monitor.robots.simulated_nao import SimulatedNao

STANDS = Scene(posture="Stand", noise=NOISELESS)
WALL = replace(STANDS, obstacles=(Obstacle((0.6, 0.0), size=(0.1, 2.0)),))


@pytest.fixture(scope="module")
def rig():
    pytest.importorskip("qi", reason="libqi has no wheel for this platform: extra nao")
    with Rig() as rig:
        yield rig
    codes = {server.process.returncode for server in rig.kept}
    assert codes <= {0, 130, -9}, "a server ends when its stdin closes"


@pytest.fixture
def crowd(rig):
    """The same scene in process, and over libqi in lock-step."""
    with contextlib.closing(NaoqiBody(rig.crowded().url, seed=rig.seed, timeout=5.0)) as there:
        yield SimulatedNao(read_scene(rig.crowd, seed=rig.seed)), there


def ended(nao, action, every=0.1):
    for _ in range(3000):
        if (outcome := action.poll()) is not None:
            return outcome
        nao.wait(every)
    raise AssertionError("an action went on for five minutes")


# The wire


@pytest.mark.parametrize("commands", [FREE, COLLIDING], ids=["free", "collision, fall, stand up"])
def test_over_libqi_in_lockstep_it_is_to_the_bit_the_one_in_process(rig, commands):
    assert identical(rig, commands)


def test_the_colliding_run_falls_and_another_seed_looks_different(rig):
    first, second = (SimulatedNao(read_scene(rig.crowd, seed=seed)) for seed in (0, 1))
    assert observed(first, COLLIDING) != observed(second, COLLIDING)
    assert first.falls
    assert not first.read().fallen


command = st.one_of(
    st.tuples(st.just("walk"), *[st.floats(-1, 1)] * 3),
    st.tuples(st.just("walk"), st.sampled_from([math.nan, 1e9, 0.0]), st.just(0.0), st.just(0.0)),
    st.tuples(st.just("posture"), st.sampled_from(["Stand", "Sit", "Crouch", "Headstand"])),
    st.tuples(st.sampled_from(["stop", "cancel"])),
    st.tuples(st.just("wait"), st.floats(0, 12)),
)


@settings(max_examples=10, deadline=None)
@given(st.lists(command, max_size=8), st.integers(0, 99))
def test_whatever_is_commanded_the_two_answer_alike(rig, commands, seed):
    here = SimulatedNao(read_scene(rig.crowd, seed=seed))
    there = NaoqiBody(rig.crowded().url, seed=seed, timeout=5.0)
    told = []
    for nao in (here, there):
        actions, seen = [], []
        for name, *arguments in commands:
            if name in ("walk", "posture"):
                actions.append(getattr(nao, name)(*arguments))
            elif name == "cancel":
                [action.cancel() for action in actions]
            else:
                getattr(nao, name)(*arguments)
            # a fall while it gets up can only be told from a failure by who looks meanwhile
            seen.append((nao.now(), repr(nao.read()), [action.poll() for action in actions]))
            for _ in range(20):
                nao.wait(0.1)
                seen.append((nao.now(), repr(nao.read()), [action.poll() for action in actions]))
        told.append(seen)
    there.close()
    assert told[0] == told[1]


def test_thinking_on_the_same_clock_moves_it_over_the_wire_too(rig):
    seen = []
    for make in (
        lambda clock: SimulatedNao(read_scene(rig.crowd, seed=4), clock),
        lambda clock: NaoqiBody(rig.crowded().url, clock, seed=4, timeout=5.0),
    ):
        clock = WorkClock(Machine("slow").with_rate("think", 0.037), start=40.0)
        nao = make(clock)
        action = nao.walk(0.0, 0.4, 0.0)
        for _ in range(40):
            clock.spend("think", 10, None)
            seen.append((repr(nao.read()), action.poll()))
        assert ended(nao, action) is Outcome.DONE
        nao.close()
    assert seen[:40] == seen[40:]


def test_after_closing_there_is_nobody(crowd):
    for nao in crowd:
        action = nao.walk(0.3, 0.0, 0.0)
        nao.close()
        assert action.poll() is Outcome.CANCELLED
        assert nao.walk(0.3, 0.0, 0.0).poll() is Outcome.LINK_LOST
        with pytest.raises(LinkLostError, match="closed"):
            nao.read()


def test_an_address_leads_to_a_body(rig):
    scene = read_scene(rig.crowd, seed=6)
    here: NaoBody = nao_body("simulated", scene)
    there: NaoBody = nao_body(f"naoqi:{rig.crowded().url}", scene)
    assert isinstance(here, SimulatedNao)
    assert here.read() == there.read()
    there.close()
    for wrong in ("naoqi", "naoqi:127.0.0.1:9559", "nao:tcp://127.0.0.1:1", ""):
        with pytest.raises(AnytimeError, match="give simulated, or naoqi:tcp"):
            nao_body(wrong, scene)
    with pytest.raises(LinkLostError, match=r"no (link|NAO)"):
        nao_body("naoqi:tcp://127.0.0.1:9", scene)


def test_a_clock_that_cannot_fit_is_refused(rig):
    with pytest.raises(AnytimeError, match="10 times its pace; give no clock"):
        NaoqiBody(rig.live().url, WallClock())
    with pytest.raises(AnytimeError, match="runs by itself"):
        NaoqiBody(rig.live().url, WorkClock(Machine("nao")))


def test_the_server_offers_what_is_documented_and_nothing_else(rig):
    with contextlib.closing(NaoqiBody(rig.crowded().url, seed=0)) as nao:
        call = nao.link.call
        assert call("ALRobotPosture", "getPosture") == "Stand"
        assert "robotHasFallen" in call("ALMemory", "getDataListName")
        assert call("ALMemory", "getListData", ["no/such/key"]) == [None]
        with pytest.raises(AnytimeError, match="no data for the key"):
            call("ALMemory", "getData", "no/such/key")
        with pytest.raises(AnytimeError, match=r"no ALMotion\.setWalkArmsEnabled"):
            call("ALMotion", "setWalkArmsEnabled", True, True)
        nao.link.send("ALMotion", "rest")
        assert call("ALMotion", "robotIsWakeUp") is False
        assert call("ALRobotPosture", "goToPosture", "Stand", 1.0) is False
        call("ALSonar", "unsubscribe", "anytime")
        assert all(map(math.isnan, nao.read().sonars)), "without a subscriber they tell nothing"


def test_silence_is_told_as_naoqi_tells_it(rig):
    with contextlib.closing(NaoqiBody(rig.live().url)) as nao:
        assert nao.link.call("ALMemory", "getListData", list(SONARS)) == [NO_ECHO, NO_ECHO]
        assert nao.read().sonars == (math.inf, math.inf)


def test_events_are_raised_for_who_subscribed(rig):
    told: queue.Queue[float] = queue.Queue()
    with contextlib.closing(NaoqiBody(rig.faulty().url, seed=0, timeout=5.0)) as nao:
        nao.wait(80.0)  # all faults are over, or to come
        subscriber = nao.link.call("ALMemory", "subscriber", "robotHasFallen")
        listening = subscriber.signal.connect(told.put)
        assert ended(nao, nao.walk(1.5, 0.0, 0.0)) is Outcome.FELL
        assert told.get(timeout=5.0) == 1.0
        assert ended(nao, nao.posture("Stand")) is Outcome.DONE
        assert told.get(timeout=5.0) == 0.0
        subscriber.signal.disconnect(listening)


def test_a_long_walk_in_pieces_goes_where_it_should_and_does_not_pause(rig):
    with contextlib.closing(NaoqiBody(rig.live().url, segment=0.2)) as nao:
        before, begun = nao.read().pose_in_world, nao.now()
        assert ended(nao, nao.walk(1.0, 0.3, 1.0), every=0.5) is Outcome.DONE
        x, y, turn = compose(inverse(before), nao.read().pose_in_world)
        assert math.hypot(x - 1.0, y - 0.3) < 0.15
        assert turn == pytest.approx(1.0, abs=0.3)
        # five pauses to stop and start would be 6 s more
        assert nao.now() - begun < math.hypot(1.0, 0.3) / 0.095 + 6.0


def test_who_thinks_too_long_finds_the_robot_standing_and_walks_on(rig):
    with contextlib.closing(NaoqiBody(rig.live().url, segment=0.2)) as nao:
        before = nao.read().pose_in_world
        action = nao.walk(0.5, 0.0, 0.0)
        while nao.read().pose_in_world == before:
            nao.clock.advance(0.2)
        while nao.read().moving:
            nao.clock.advance(0.5)
        assert math.dist(nao.read().pose_in_world[:2], before[:2]) == pytest.approx(0.2, abs=0.08)
        assert ended(nao, action) is Outcome.DONE
        assert math.dist(nao.read().pose_in_world[:2], before[:2]) == pytest.approx(0.5, abs=0.08)


# Failures


@pytest.mark.parametrize("name", FAILURES)
def test_what_goes_wrong_ends_as_it_should(rig, name):
    assert FAILURES[name](rig)


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="who listens is told by Linux")
def test_the_server_listens_on_loopback_alone(rig):
    port = f":{rig.live().port:04X}"
    tables = [Path(f"/proc/net/{name}") for name in ("tcp", "tcp6")]
    lines = [line.split() for table in tables if table.exists() for line in table.open()]
    listens = [line[1] for line in lines if line[3] == "0A" and line[1].endswith(port)]
    assert listens == [f"0100007F{port}"]


ILL_TYPED = [
    ("ALMotion", "moveTo", ("far", {}, [])),
    ("ALMotion", "moveTo", (math.nan, 0.0, 0.0)),
    ("ALMotion", "moveTo", (0.0, math.inf, 0.0)),
    ("ALMotion", "moveTo", (None, None, None)),
    ("ALMotion", "moveTo", (True, 0.0, 0.0)),
    ("ALMotion", "moveTo", (1e9, 0.0, 0.0)),
    ("ALMotion", "moveTo", (1.0, 2.0)),
    ("ALMotion", "fly", (1.0,)),
    ("ALRobotPosture", "goToPosture", (["Sit"], {})),
    ("ALRobotPosture", "goToPosture", ("Fly", 1.0)),
    ("SimClock", "begin", ("a", None)),
    ("SimClock", "begin", (math.nan, None)),
    ("SimClock", "settle", ({}, "a")),
    ("SimClock", "settle", (1e300, 0)),
]


def test_calls_that_make_no_sense_move_nothing_and_disturb_nobody(rig):
    with contextlib.closing(NaoqiBody(rig.crowded().url, seed=0, timeout=5.0)) as nao:
        before = nao.read()
        for service, method, arguments in ILL_TYPED:
            told = ""
            try:
                assert nao.link.call(service, method, *arguments) is False, (method, arguments)
            except AnytimeError as error:
                told = str(error)
            assert str(Path(__file__).parents[2]) not in told, "no paths of ours"
            assert "Traceback" not in told
        assert nao.read() == before
        nao.wait(1.0)
        assert nao.read().pose_in_world == before.pose_in_world


def test_connections_that_speak_nonsense_harm_nobody(rig):
    harm = hostile_clients.harmed(rig.crowded(), connections=100, calls=100, seed=0)
    assert harm.motions == 0
    assert harm.taken == harm.told == []
    with contextlib.closing(NaoqiBody(rig.crowded().url, seed=0, timeout=5.0)) as good:
        assert ended(good, good.walk(0.1, 0.0, 0.0)) is Outcome.DONE


def test_a_server_ends_on_ctrl_c(rig):
    # Who runs the tests in the background of a script has them ignore it, and so what they start.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        server = rig.keep(ServedNao("--lockstep"))
    finally:
        signal.signal(signal.SIGINT, before)
    server.process.send_signal(signal.SIGINT)
    assert server.process.wait(10.0) == 130


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--scene", "moon"), "no scene 'moon'; there are appearing"),
        (("--fault", "flood"), "no fault 'flood'"),
        (("--port", "70000"), "0 (any) to 65535"),
        (("--rate", "1e9"), "rate is 1e+09; the simulation keeps up with 1000"),
    ],
)
def test_what_the_command_cannot_do_it_says_in_one_line(options, complaint, capsys):
    from anytime.__main__ import main

    assert main(["nao-sim", *options]) == 2
    told = capsys.readouterr().err
    assert complaint in told
    assert len(told.splitlines()) == 1


def test_without_libqi_one_line_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "qi", None)
    with pytest.raises(
        AnytimeError, match=r"pip install 'anytime-robots\[nao\]' .* \(this is "
    ) as told:
        NaoqiBody("tcp://127.0.0.1:9")
    assert "\n" not in str(told.value)


def test_a_password_comes_from_the_environment_and_goes_into_the_handshake_alone(
    monkeypatch, tmp_path
):
    monkeypatch.delenv(naoqi_link.PASSWORD, raising=False)
    assert password() is None
    monkeypatch.setenv(naoqi_link.PASSWORD, "secret")
    assert password() == "secret"
    (tmp_path / "token").write_text("other\n")
    monkeypatch.setenv(f"{naoqi_link.PASSWORD}_FILE", str(tmp_path / "token"))
    assert password() == "other"
    factory = AuthenticatorFactory("nao", "secret")
    assert factory.newAuthenticator().initialAuthData() == {"user": "nao", "token": "secret"}
    assert "secret" not in repr(factory)
    monkeypatch.setenv(f"{naoqi_link.PASSWORD}_FILE", str(tmp_path / "none"))
    with pytest.raises(AnytimeError, match="cannot be read"):
        password()


pose = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))


@given(pose, st.floats(-1, 1), st.floats(-1, 1), st.floats(-6, 6))
def test_what_is_left_of_a_walk_is_all_of_it_at_its_start_and_nothing_at_its_end(start, x, y, turn):
    way = Way(start, x, y, turn)
    if way.length > 0.01:
        assert way.rest(start) == pytest.approx((x, y, turn), abs=1e-6)
        end = compose(start, (x, y, turn))
        assert way.rest(end) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


# The watch


@given(
    st.lists(st.tuples(st.floats(0.0, 0.4), st.floats(0.0, 2.0), st.floats(0.0, 2.0)), max_size=30),
    st.floats(0.0, 3.0),
)
def test_a_robot_that_may_walk_has_heard_of_somebody_who_lived_within_the_limit(beats, later):
    """Each beat is sent so long after the answer, and beat and answer take so long on their way."""
    now = sent = 1.0
    watch = Watch(lambda: now)
    echo = 0.0
    for pause, there, back in beats:
        sent = now + pause
        now = sent + there
        echo = watch.beat(echo)
        assert watch.silent or math.isnan(watch.heard) or now - sent <= LIMIT
        now += back
    now += later
    assert watch.silent or math.isnan(watch.heard) or now - sent <= LIMIT


def test_who_takes_leave_is_waited_for_no_more_and_who_overtook_it_is():
    now = 1.0
    watch = Watch(lambda: now)
    first = watch.beat(0.0)
    now = 1.1
    second = watch.beat(first)
    watch.leave(first)
    assert math.isnan(watch.heard)
    watch.beat(first)
    assert math.isnan(watch.heard), "a beat that was on its way"
    now = 1.2
    watch.beat(second)
    watch.leave(first)
    assert watch.heard == second, "a leave that was on its way"
    now = 9.0
    assert watch.silent


@pytest.mark.slow
@pytest.mark.parametrize("kind", range(len(link_faults.KINDS)))
def test_whatever_happens_to_the_link_the_robot_stands_within_a_second(rig, kind):
    with contextlib.closing(link_faults.Lane(rig.floor)) as lane:
        seen = link_faults.trial(lane, kind, 0)
    assert seen.moved
    assert seen.halt <= 1.0
    assert seen.after == seen.unwatched == 0


# Faults


def test_without_a_fault_it_is_the_body_itself(rig):
    scene = read_scene(rig.crowd, seed=3)
    assert observed(Faulty(SimulatedNao(scene)), FREE) == observed(SimulatedNao(scene), FREE)


def under(kind, scene=STANDS, begins=0.0, ends=math.inf):
    return Faulty(SimulatedNao(scene), [Fault(kind, begins, ends)])


def test_a_server_whose_link_is_lost_on_purpose_is_silent_until_it_is_back(rig):
    server = rig.keep(ServedNao("--fault", "link:0:0.5"))
    with contextlib.closing(NaoqiBody(server.url, timeout=5.0)) as there:
        assert there.read().posture == "Sit"
    server.close()
    assert server.process.returncode == 0


@pytest.mark.parametrize("lockstep", [(), ("--lockstep",)])
def test_a_server_whose_link_never_comes_back_begins_and_ends_nevertheless(rig, lockstep):
    server = rig.keep(ServedNao(*lockstep, "--fault", "link"))
    server.close()
    assert server.process.returncode == 0


def test_a_lost_link_ends_what_was_in_execution_and_comes_back():
    nao = under("link", begins=1.0, ends=2.0)
    action = nao.walk(1.0, 0.0, 0.0)
    nao.wait(1.5)
    assert action.poll() is Outcome.LINK_LOST
    assert nao.walk(0.1, 0.0, 0.0).poll() is Outcome.LINK_LOST
    assert nao.posture("Sit").poll() is Outcome.LINK_LOST
    with pytest.raises(LinkLostError, match="planned"):
        nao.read()
    nao.wait(1.0)
    assert action.poll() is Outcome.LINK_LOST
    assert nao.read().moving


def test_a_fall_may_be_told_by_its_posture_alone():
    nao = under("fall-event", WALL)
    assert ended(nao, nao.walk(1.0, 0.0, 0.0)) is Outcome.FELL
    assert (nao.read().fallen, nao.read().posture) == (False, LYING)


def test_faults_of_the_readings():
    assert under("fall").read().fallen
    assert under("sonar-zero").read().sonars == (0.0, 0.0)
    assert all(map(math.isnan, under("sonar-nan").read().sonars))
    assert all(map(math.isnan, under("odometry-nan").read().pose_in_world))
    assert under("odometry-jump").read().pose_in_world == (1.0, -0.5, 0.8)
    side = replace(STANDS, obstacles=(Obstacle((0.5, 0.4), radius=0.1),))
    left, right = SimulatedNao(side).read().sonars
    assert under("sonar-swapped", side).read().sonars == (right, left) != (left, right)


@pytest.mark.parametrize(("kind", "field"), [("sonar-stuck", "sonars"), ("odometry-frozen", None)])
def test_what_is_stuck_stays_what_it_was(kind, field):
    nao = under(kind, WALL)
    before = getattr(nao.read(), field or "pose_in_world")
    nao.walk(0.2, 0.0, 0.0)
    nao.wait(3.0)
    assert getattr(nao.read(), field or "pose_in_world") == before
    assert getattr(nao.body.read(), field or "pose_in_world") != before


def test_without_stiffness_a_walk_is_done_and_goes_nowhere():
    nao = under("stiffness")
    assert nao.walk(1.0, 0.0, 0.0).poll() is Outcome.DONE
    nao.wait(5.0)
    assert nao.read().pose_in_world == (0.0, 0.0, 0.0)
    assert under("posture").posture("Sit").poll() is Outcome.REFUSED


def test_faults_are_read_and_what_is_none_is_refused():
    assert read_fault("posture") == Fault("posture")
    assert read_fault("link:1:2.5") == Fault("link", 1.0, 2.5)
    assert all(read_fault(f"{kind}:3").begins == 3.0 for kind in KINDS)
    for wrong in ("", "flood", "link:x", "link:2:1", "link:1:2:3", "link:-1", "link:nan"):
        with pytest.raises(AnytimeError):
            read_fault(wrong)


# Recordings


def test_a_recorded_run_replays_to_the_bit(tmp_path, rig):
    path, scene = tmp_path / "run.jsonl", read_scene(rig.crowd, seed=3)
    recorder = Recorder(under("sonar-nan", scene, 5.0, 9.0), path)
    seen = observed(recorder, COLLIDING)
    recorder.close()
    replay = Replay(path)
    assert observed(replay, COLLIDING) == seen
    replay.close()


def test_a_replay_advances_the_clock_and_loses_the_link_when_the_run_did(tmp_path):
    path = tmp_path / "run.jsonl"
    seen = []
    clock = WorkClock(Machine("nao"))
    for make in (lambda: Recorder(under("link", begins=1.0), path), lambda: Replay(path, clock)):
        nao = make()
        action = nao.walk(0.3, 0.0, 0.0)
        nao.wait(2.0)
        with pytest.raises(LinkLostError) as lost:
            nao.read()
        seen.append((str(lost.value), action.poll()))
        action.cancel()
        nao.stop()
        nao.close()
    assert seen[0] == seen[1]
    assert clock.now() == 2.0


def test_a_run_that_differs_from_the_recorded_one_is_told_where(tmp_path):
    path = tmp_path / "run.jsonl"
    recorder = Recorder(SimulatedNao(STANDS), path)
    recorder.walk(0.3, 0.0, 0.0)
    recorder.read()
    recorder.close()
    with pytest.raises(AnytimeError, match=r"line 2: recorded walk\(0.3, .*, now walk\(0.4"):
        Replay(path).walk(0.4, 0.0, 0.0)
    replay = Replay(path)
    replay.walk(0.3, 0.0, 0.0)
    replay.read()
    replay.next("close", [], None)
    with pytest.raises(AnytimeError, match=r"ends before read\(\)"):
        replay.read()


def test_what_is_no_recording_is_refused_and_a_torn_end_is_not(tmp_path):
    path = tmp_path / "run.jsonl"
    with pytest.raises(AnytimeError, match="no such recording"):
        Replay(path)
    for wrong in ("", "[]\n", "{}\n", '{"nao_recording": 99}\n', "\x00"):
        path.write_text(wrong)
        with pytest.raises(AnytimeError, match="not a recording"):
            Replay(path)
    recorder = Recorder(SimulatedNao(STANDS), path)
    recorder.now()
    path.write_text(path.read_text() + '{"call": "re')
    replay = Replay(path)
    assert replay.now() == 0.0
    with pytest.raises(AnytimeError, match="ends before"):
        replay.read()
    recorder.close()


def gave(call, *arguments):
    return lambda gave: json.dumps({"call": call, "with": arguments, "gave": gave})


SEEN = {
    "time": 0.0,
    "pose_in_world": [0.0, 0.0, 0.0],
    "posture": "Stand",
    "fallen": False,
    "moving": False,
    "sonars": [{"float": "nan"}, {"float": "inf"}],
}


def test_a_reading_comes_back_from_a_recording_as_it_was(tmp_path):
    path = tmp_path / "run.jsonl"
    path.write_text(f'{{"nao_recording": 1}}\n{gave("read")(SEEN)}\n')
    reading = Replay(path).read()
    assert reading.pose_in_world == (0.0, 0.0, 0.0)
    assert math.isnan(reading.sonars[0])
    assert reading.sonars[1] == math.inf


@pytest.mark.parametrize(
    "line",
    [
        *("[]", "3", '{"call": 1, "with": 2}', "[" * 5000 + "]" * 5000),
        *map(gave("read"), (None, 3, [], {}, {"lost": 3}, {**SEEN, "sonars": [1.0]})),
        *map(gave("read"), ({**SEEN, "fallen": 2}, {**SEEN, "time": "x"})),
        gave("read")({**SEEN, "time": {"float": []}}),
    ],
)
def test_a_line_that_is_no_call_is_refused_with_its_number(tmp_path, line):
    path = tmp_path / "run.jsonl"
    path.write_text(f'{{"nao_recording": 1}}\n{line}\n{gave("now")(0.0)}\n')
    with pytest.raises(AnytimeError, match="line 2") as refused:
        Replay(path).read()
    assert "\n" not in str(refused.value)


# Documentation


def test_the_page_lists_what_is_served_and_what_can_go_wrong():
    page = (Path(__file__).parents[2] / "docs" / "nao.md").read_text(encoding="utf-8")
    for service in (Motion, Postures, Memory, Listening, SimClock, Watching):
        for method in vars(service):
            assert method.startswith("_") or f"`{method}(" in page, method
    assert all(f"`{kind}`" in page for kind in KINDS)
    assert all(name in page for name in (FALLEN, SONARS[0]))
