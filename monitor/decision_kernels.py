"""The machine code of a decision process: its optimum, the worth of a policy, missions by chance.

An action is a small integer: 2 i + k walks at speed i, and k = 1 thinks while it does;
2 V + k stands, with V speeds; 2 V + 2 starts the next frame, which takes no time.
A layer is [F + 1, X, Y]: frames still to plan, cells of path left, level of the next plan.
"""

import numpy as np

from anytime.machine_code import njit


@njit(cache=True, nogil=True, error_model="numpy")
def think(planning, price, after, thought):
    """What a layer is worth a tick earlier to one who thinks in between, into `thought`."""
    frames, cells, levels = after.shape
    for f in range(frames):
        for x in range(cells):
            for y in range(levels):
                total = -price
                for z in range(levels):
                    total += planning[y, z] * after[f, x, z]
                thought[f, x, y] = total


@njit(cache=True, nogil=True, error_model="numpy")
def solve(lengths, planning, progress, energy, price, value, actions, worth):
    """Fill `actions`, `worth` [T, F + 1, X, Y] backwards in time; returns the worth at the start.

    From the last tick on a mission is worth nothing.
    """
    ticks, frames, cells, levels = actions.shape
    speeds = len(progress)
    shape = (frames, cells, levels)
    after, now, thought = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    first = np.zeros(speeds, np.int64)
    last = np.zeros(speeds, np.int64)
    for v in range(speeds):
        reached = np.flatnonzero(progress[v])
        first[v], last[v] = reached[0], reached[-1] + 1
    best, code, here = np.zeros(levels), np.zeros(levels, np.int8), np.zeros(levels)
    for t in range(ticks - 1, -1, -1):
        think(planning, price, after, thought)
        for f in range(frames):
            wide = levels if f > 0 else 1
            for x in range(1, cells):
                best[:] = -np.inf
                for k in range(2 if f > 0 else 1):
                    source = thought if k == 1 else after
                    for v in range(speeds):
                        here[:wide] = -energy[v]
                        for s in range(first[v], last[v]):
                            share, left = progress[v, s], max(x - s, 0)
                            for y in range(wide):
                                here[y] += share * source[f, left, y]
                        for y in range(wide):
                            # Thinking that costs nothing does no harm: in doubt, think.
                            if here[y] > best[y] or (k == 1 and here[y] == best[y]):
                                best[y], code[y] = here[y], 2 * v + k
                for y in range(levels):
                    now[f, x, y] = best[y if f > 0 else 0]
                    actions[t, f, x, y] = code[y if f > 0 else 0]
            if f == 0:
                now[0, 0, :] = value[t]
                actions[t, 0, 0, :] = 2 * speeds
                continue
            for y in range(levels):
                now[f, 0, y], actions[t, f, 0, y] = thought[f, 0, y], 2 * speeds + 1
                if after[f, 0, y] > thought[f, 0, y]:  # no more to be had: give up
                    now[f, 0, y], actions[t, f, 0, y] = after[f, 0, y], 2 * speeds
                if lengths[y] > 0 and now[f - 1, lengths[y], 0] >= now[f, 0, y]:
                    now[f, 0, y] = now[f - 1, lengths[y], 0]
                    actions[t, f, 0, y] = 2 * speeds + 2
        for f in range(frames):  # one by one, or numba compiles numpy's words for other shapes
            for x in range(cells):
                for y in range(levels):
                    worth[t, f, x, y] = now[f, x, y]
        after, now = now, after
    return after[frames - 1, 0, 0]


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(lengths, planning, progress, energy, price, value, actions):
    """The expected net value of acting by `actions` [T, F + 1, X, Y] from the start."""
    ticks, frames, cells, levels = actions.shape
    speeds, steps = progress.shape
    shape = (frames, cells, levels)
    after, now, thought = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for t in range(ticks - 1, -1, -1):
        think(planning, price, after, thought)
        now[0, 0, :] = value[t]
        for f in range(frames):
            for x in range(0 if f > 0 else 1, cells):
                for y in range(levels):
                    action = actions[t, f, x, y]
                    if action == 2 * speeds + 2:
                        now[f, x, y] = now[f - 1, lengths[y], 0]
                        continue
                    v, k = action >> 1, action & 1
                    source = thought if k == 1 and f > 0 else after
                    if v == speeds:
                        now[f, x, y] = source[f, x, y]
                        continue
                    total = -energy[v]
                    for s in range(steps):
                        if progress[v, s] > 0:
                            total += progress[v, s] * source[f, max(x - s, 0), y]
                    now[f, x, y] = total
        after, now = now, after
    return after[frames - 1, 0, 0]


@njit(cache=True, nogil=True, error_model="numpy")
def draw(shares, u):
    """The index that a uniform number falls on, of shares that sum to one."""
    last = 0
    for i in range(len(shares)):
        if shares[i] > 0:
            last = i
            if u < shares[i]:
                return i
            u -= shares[i]
    return last


@njit(cache=True, nogil=True, error_model="numpy")
def simulate(lengths, planning, progress, energy, price, value, actions, chance):
    """Net values of missions lived by `actions`. chance: [N, T, 2] uniform numbers."""
    ticks, frames, _, _ = actions.shape
    speeds = len(energy)
    net = np.zeros(len(chance))
    for n in range(len(chance)):
        f, x, y, t = frames - 1, 0, 0, 0
        while t < ticks:
            if f == 0 and x == 0:
                net[n] += value[t]
                break
            action = actions[t, f, x, y]
            if action == 2 * speeds + 2:
                f, x, y = f - 1, lengths[y], 0
                continue
            v, k = action >> 1, action & 1
            if k == 1 and f > 0:
                y = draw(planning[y], chance[n, t, 0])
                net[n] -= price
            if v < speeds:
                x = max(x - draw(progress[v], chance[n, t, 1]), 0)
                net[n] -= energy[v]
            t += 1
    return net


@njit(cache=True, nogil=True, error_model="numpy")
def steer(speed, gain, tau, contract, x, y, pace, advertised, speeds):
    """The speed within a frame by [ZR93] §5: faster if planning is ahead and execution behind,
    slower if planning is behind and execution ahead. pace: cells a tick at each speed."""
    if gain <= 0 or contract <= 0:
        return speed
    late = (tau + x / pace[speed] - contract) / contract
    ahead = y >= advertised[min(tau, len(advertised) - 1)]
    wanted = pace[speed]
    if ahead and late > 0:
        wanted *= 1 + gain * min(late, 1.0)
    elif not ahead and late < 0:
        wanted *= 1 - gain * min(-late, 0.9)
    else:
        return speed
    best = 0
    for v in range(speeds):
        if abs(pace[v] - wanted) < abs(pace[best] - wanted):
            best = v
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def frame(
    planning, progress, energy, price, x, y, contract, speed, gain, pace, advertised, over, spent
):
    """A frame by chance: fills `over` [T, Y], the chance that it ends after so many ticks with a
    next plan of each level, and `spent` [T], the energy to expect in each tick.

    It thinks for its contract, longer while there is no plan, and ends when the path is walked
    too; a planner that can do no better ends its contract early.
    """
    ticks, levels = over.shape
    speeds, steps = progress.shape
    top = levels - 1
    now, after = np.zeros((x + 1, levels)), np.zeros((x + 1, levels))
    now[x, y] = 1.0
    for tau in range(ticks):
        after[:] = 0.0
        alive = 0.0
        for i in range(x + 1):
            for j in range(levels):
                share = now[i, j]
                if share < 1e-15:
                    continue
                thinks = j == 0 or (tau < contract and j < top)
                if i == 0 and not thinks:
                    over[tau, j] += share
                    continue
                alive += share
                if thinks:
                    spent[tau] += share * price
                v = -1
                if i > 0:
                    v = steer(speed, gain, tau, contract, i, j, pace, advertised, speeds)
                    spent[tau] += share * energy[v]
                for z in range(levels):
                    level = planning[j, z] if thinks else (1.0 if z == j else 0.0)
                    if level <= 0:
                        continue
                    if v < 0:
                        after[i, z] += share * level
                        continue
                    for s in range(steps):
                        if progress[v, s] > 0:
                            after[max(i - s, 0), z] += share * level * progress[v, s]
        now, after = after, now
        if alive < 1e-15:
            return


@njit(cache=True, nogil=True, error_model="numpy")
def simulate_frames(
    lengths, planning, progress, energy, price, value, contracts, speed, gain, pace, advertised,
    chance,
):  # fmt: skip
    """Net values of missions lived frame by frame. contracts, speed: [F + 1, T, Y] by frames still
    to plan, tick, and level of the plan in hand. chance: [N, T, 2]."""
    frames, ticks, levels = contracts.shape
    net = np.zeros(len(chance))
    top = levels - 1
    for n in range(len(chance)):
        f, x, y, t, began, hand = frames - 1, 0, 0, 0, 0, 0
        while t < ticks:
            if f == 0 and x == 0:
                net[n] += value[t]
                break
            contract, chosen = contracts[f, began, hand], speed[f, began, hand]
            thinks = f > 0 and (y == 0 or (t - began < contract and y < top))
            if x == 0 and not thinks:
                f, x, hand, y, began = f - 1, lengths[y], y, 0, t
                continue
            if x > 0:
                if f > 0:
                    chosen = steer(
                        chosen, gain, t - began, contract, x, y, pace, advertised, len(energy)
                    )
                x = max(x - draw(progress[chosen], chance[n, t, 1]), 0)
                net[n] -= energy[chosen]
            if thinks:
                y = draw(planning[y], chance[n, t, 0])
                net[n] -= price
            t += 1
    return net


@njit(cache=True, nogil=True, error_model="numpy")
def resolve(lengths, energy, price, pace, until, worth, actions):
    """Fill `actions` [T, F + 1, X, Y] with what is best if all goes as expected from there.

    until: [Y, Y] ticks of thinking from a level to a level. worth: [T, R] of completing, now and
    ticks left. One speed is chosen for all the frames that are left, and the level to plan to for
    the next; the plans of the frames after it are thought out to the level that is soonest
    through at that speed.
    """
    ticks, frames, cells, levels = actions.shape
    speeds, longest = len(energy), worth.shape[1] - 1
    later = np.ones(speeds, np.int64)
    for v in range(speeds):
        for level in range(2, levels):
            each = max(until[0, level], lengths[level] / pace[v])
            if each <= max(until[0, later[v]], lengths[later[v]] / pace[v]):
                later[v] = level
    # What each choice takes and costs does not depend on the tick.
    choices = speeds * levels
    low, part = np.zeros(choices, np.int64), np.zeros(choices)
    cost, code = np.zeros(choices), np.zeros(choices, np.int8)
    for f in range(frames):
        for x in range(cells):
            for y in range(levels):
                count = 0
                for v in range(speeds):
                    wait = until[0, later[v]]
                    each = lengths[later[v]] / pace[v]
                    for aim in range(max(y, 1), levels if f > 0 else max(y, 1) + 1):
                        walk = x / pace[v]
                        left, thought = walk, 0.0
                        if f > 0:
                            next_walk = lengths[aim] / pace[v]
                            thought = until[y, aim] + (f - 1) * wait
                            left = max(until[y, aim], walk)
                            walk += next_walk + (f - 1) * each
                            if f > 1:
                                left += max(wait, next_walk) + (f - 2) * max(wait, each) + each
                            else:
                                left += next_walk
                        low[count] = min(int(left), longest - 1)
                        part[count] = min(left - low[count], 1.0)
                        cost[count] = energy[v] * walk + price * thought
                        code[count] = 2 * speeds
                        if x > 0:
                            code[count] = 2 * v + (1 if y < aim and f > 0 else 0)
                        elif f > 0:
                            code[count] += 2 if y == aim else 1
                        count += 1
                for t in range(ticks):
                    best = -np.inf
                    for i in range(count):
                        here = worth[t, low[i]]
                        net = here + part[i] * (worth[t, low[i] + 1] - here) - cost[i]
                        if net > best:
                            best, actions[t, f, x, y] = net, code[i]
