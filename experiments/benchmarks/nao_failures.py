"""What goes wrong with a NAO over NAOqi, done to it on purpose, and whether it ends as it should.

Every row is real: libqi on loopback, servers and clients that are processes and are killed.
"""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

from experiments.benchmarks.nao_rig import Rig
from experiments.nao_serving import FaultProxy, ServedNao
from monitor.robots.nao_body import Action, LinkLostError, NaoBody, Outcome, Reading
from monitor.robots.naoqi import NaoqiBody

_SEGMENT = 0.3
_TICK = 0.2  # real seconds that noticing may take beyond what is promised, on a busy machine

WALKER = """
import math, sys
from monitor.robots.naoqi import NaoqiBody
nao = NaoqiBody(sys.argv[1], segment=float(sys.argv[2]))
begun = nao.read().pose_in_world[:2]
action = nao.walk(5.0, 0.0, 0.0)
while math.dist(nao.read().pose_in_world[:2], begun) < 0.5:
    nao.wait(0.5)
print("WALKS", flush=True)
while action.poll() is None:
    nao.wait(0.5)
"""
"""A client that walks until it is killed."""


def failures(seed: int = 0) -> dict[str, bool]:
    """What can go wrong, and whether it ended as it should."""
    with Rig(seed) as rig:
        return {name: handled(rig) for name, handled in FAILURES.items()}


def server_killed(rig: Rig) -> bool:
    """The server dies in mid-move: the link is lost within its time."""
    server = rig.keep(ServedNao(*rig.live_options()))
    nao = NaoqiBody(server.url)
    action = _walking(nao)
    server.kill()
    return _ended(nao, action, 0.1 + _TICK) is Outcome.LINK_LOST and _is_lost(nao)


def server_restarted(rig: Rig) -> bool:
    """Another server takes the place of a dead one: the body connects anew, and walks."""
    server = rig.keep(ServedNao(*rig.live_options()))
    nao = NaoqiBody(server.url)
    action = _walking(nao)
    server.kill()
    _ended(nao, action, 1.0)
    rig.keep(ServedNao(*rig.live_options(server.port)))
    reading = _readable(nao, 10.0)
    heard = not any(map(math.isnan, reading.sonars))  # subscribed anew
    with contextlib.closing(nao):
        return heard and not reading.moving and _done(nao, nao.walk(0.1, 0.0, 0.0))


def link_silent(rig: Rig) -> bool:
    """Nothing comes through any more: the link is lost when a call has taken half a second."""
    with _proxied(rig) as (proxy, nao):
        action = _walking(nao)
        proxy.silence()
        return _ended(nao, action, 0.5 + _TICK) is Outcome.LINK_LOST


def link_healed(rig: Rig) -> bool:
    """A silent link heals: the robot is stopped before anything else, and no command comes back."""
    with _proxied(rig) as (proxy, nao):
        action = _walking(nao)
        proxy.silence()
        lost = _ended(nao, action, 0.5 + _TICK) is Outcome.LINK_LOST
        proxy.heal()
        return lost and not _readable(nao, 10.0).moving and action.poll() is Outcome.LINK_LOST


def link_reset(rig: Rig) -> bool:
    """The connection is reset: the link is lost at once, and made anew."""
    with _proxied(rig) as (proxy, nao):
        action = _walking(nao)
        proxy.reset()
        lost = _ended(nao, action, 0.1 + _TICK) is Outcome.LINK_LOST
        return lost and not _readable(nao, 10.0).moving


def link_slow(rig: Rig) -> bool:
    """Everything takes 20 ms more each way: it walks as far as it should, and nothing is lost."""
    with _proxied(rig) as (proxy, nao):
        proxy.delay = 0.02
        begun = nao.read().pose_in_world[:2]
        done = _done(nao, nao.walk(0.4, 0.0, 0.0))
        return done and abs(math.dist(nao.read().pose_in_world[:2], begun) - 0.4) < 0.1


def client_killed(rig: Rig) -> bool:
    """Our own process dies in mid-move: the robot stops within one segment."""
    watcher = NaoqiBody(rig.live().url)
    command = [sys.executable, "-c", WALKER, rig.live().url, str(_SEGMENT)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as walker:
        assert walker.stdout is not None
        walks = walker.stdout.readline().strip() == "WALKS"
        walker.kill()
        walker.wait()
    at_death = _truth(watcher)
    until = time.perf_counter() + 5.0
    while (moving := watcher.read().moving) and time.perf_counter() < until:
        watcher.wait(0.5)
    farther = math.dist(at_death, _truth(watcher))
    watcher.close()
    return walks and not moving and farther < 1.2 * _SEGMENT


def posture_refused(rig: Rig) -> bool:
    """The robot does not take a posture: the action fails, and the body stays usable."""
    with _at(rig, 20.0) as nao:
        failed = _outcome(nao, nao.posture("Sit")) is Outcome.FAILED
        nao.wait(5.0)
        return failed and _outcome(nao, nao.posture("Sit")) is Outcome.DONE


def posture_unknown(rig: Rig) -> bool:
    """Half-way between two postures: no walk is begun."""
    with _at(rig, 0.0) as nao:
        sitting = nao.posture("Sit")
        nao.wait(4.0)
        sitting.cancel()
        return nao.walk(0.1, 0.0, 0.0).poll() is Outcome.REFUSED and not nao.read().moving


def fall_event_lost(rig: Rig) -> bool:
    """It falls over something, and only its posture says so: seen within a second."""
    with _at(rig, 120.0) as nao:
        walk = nao.walk(1.5, 0.1, 0.0)
        fell, lay = _outcome(nao, walk, every=0.5), nao.read()
        refused = nao.walk(0.1, 0.0, 0.0).poll() is Outcome.REFUSED
        up = any(_outcome(nao, nao.posture("Stand")) is Outcome.DONE for _ in range(5))
        return fell is Outcome.FELL and lay.fallen and refused and up


def fall_untouched(rig: Rig) -> bool:
    """It lies without having touched anything: no walk, until it stands again."""
    with _at(rig, 44.0) as nao:
        walk = nao.walk(0.5, 0.0, 0.0)
        nao.wait(2.0)
        fell = walk.poll() is Outcome.FELL and nao.read().fallen
        refused = nao.walk(0.1, 0.0, 0.0).poll() is Outcome.REFUSED
        nao.wait(5.0)
        return fell and refused and _outcome(nao, nao.posture("Stand")) is Outcome.DONE


def sonar_nan(rig: Rig) -> bool:
    """A sonar that tells NaN or 0 tells nothing; it does not tell that the way is free."""
    with _at(rig, 0.5) as nao:
        before = nao.read().sonars
        nao.wait(1.0)
        broken = nao.read().sonars
        nao.wait(1.0)
        zero = nao.read().sonars
        return all(map(math.isnan, (*broken, *zero))) and not any(map(math.isnan, before))


def odometry_jump(rig: Rig) -> bool:
    """The pose jumps: it is noticed, and the body's frame is laid anew so that its own does not."""
    with _at(rig, 4.9) as nao:
        before = nao.read().pose_in_world
        nao.wait(0.2)
        after = nao.read().pose_in_world
        near = math.dist(before[:2], after[:2]) < 0.05
        return near and nao.odometry.jumps == 1


def odometry_nan(rig: Rig) -> bool:
    """A pose that is none is not told on: the last one stands for a second, then nothing does."""
    with _at(rig, 9.9) as nao:
        before = nao.read().pose_in_world
        nao.wait(0.4)
        held = nao.read().pose_in_world == before
        nao.wait(2.7)
        return held and _is_lost(nao)


def odometry_frozen(rig: Rig) -> bool:
    """It says that it walks, and its pose stays: the walk is broken off."""
    with _at(rig, 60.0) as nao:
        walk = nao.walk(0.0, 0.8, 0.0)
        return _outcome(nao, walk, every=0.5) is Outcome.TIMEOUT and not nao.read().moving


def motors_off(rig: Rig) -> bool:
    """A walk that ends well without a motion is not done."""
    with _at(rig, 30.0) as nao:
        return _outcome(nao, nao.walk(0.4, 0.0, 0.0)) is Outcome.FAILED


def other_client(rig: Rig) -> bool:
    """Somebody else commands the robot: our action ends, and the next one is ours again."""
    nao, other = NaoqiBody(rig.live().url), NaoqiBody(rig.live().url)
    with contextlib.closing(nao), contextlib.closing(other):
        ours = _walking(nao)
        other.stop()
        ended = _ended(nao, ours, 1.0) in (Outcome.FAILED, Outcome.DONE)
        return ended and _done(nao, nao.walk(0.1, 0.0, 0.0))


FAILURES: dict[str, Callable[[Rig], bool]] = {
    handler.__name__: handler
    for handler in (
        server_killed,
        server_restarted,
        link_silent,
        link_healed,
        link_reset,
        link_slow,
        client_killed,
        posture_refused,
        posture_unknown,
        fall_event_lost,
        fall_untouched,
        sonar_nan,
        odometry_jump,
        odometry_nan,
        odometry_frozen,
        motors_off,
        other_client,
    )
}
"""The rows, by name."""


@contextlib.contextmanager
def _proxied(rig: Rig) -> Iterator[tuple[FaultProxy, NaoqiBody]]:
    """A body on the live server, and what its link leads through."""
    proxy = FaultProxy(rig.live().port)
    nao = NaoqiBody(proxy.url)
    try:
        yield proxy, nao
    finally:
        proxy.heal()
        nao.close()
        proxy.close()


@contextlib.contextmanager
def _at(rig: Rig, seconds: float) -> Iterator[NaoqiBody]:
    """A body on the server with faults, when so much time has passed."""
    nao = NaoqiBody(rig.faulty().url, seed=rig.seed, timeout=5.0)
    with contextlib.closing(nao):
        nao.wait(seconds)
        yield nao


def _walking(nao: NaoqiBody) -> Action:
    """A long walk that has begun."""
    action = nao.walk(3.0, 0.0, 0.0)
    begun = nao.read().pose_in_world[:2]
    until = time.perf_counter() + 5.0
    while math.dist(nao.read().pose_in_world[:2], begun) < 0.05 and time.perf_counter() < until:
        nao.wait(0.2)
    return action


def _ended(nao: NaoBody, action: Action, seconds: float) -> Outcome | None:
    """How an action ended within so many real seconds."""
    until = time.perf_counter() + seconds
    while (outcome := action.poll()) is None and time.perf_counter() < until:
        nao.wait(0.1)
    return outcome


def _outcome(nao: NaoBody, action: Action, every: float = 0.2) -> Outcome | None:
    """How an action ended within a minute of the robot's time."""
    until = nao.now() + 60.0
    while (outcome := action.poll()) is None and nao.now() < until:
        nao.wait(every)
    return outcome


def _done(nao: NaoBody, action: Action) -> bool:
    return _outcome(nao, action) is Outcome.DONE


def _is_lost(nao: NaoBody) -> bool:
    try:
        nao.read()
    except LinkLostError:
        return True
    return False


def _readable(nao: NaoBody, seconds: float) -> Reading:
    """The first reading within so many real seconds. Raises LinkLostError."""
    until = time.perf_counter() + seconds
    while True:
        try:
            return nao.read()
        except LinkLostError:
            if time.perf_counter() > until:
                raise
            nao.wait(0.2)


def _truth(nao: NaoqiBody) -> tuple[float, float]:
    x, y, *_ = nao.link.call("SimClock", "truth")
    return x, y
