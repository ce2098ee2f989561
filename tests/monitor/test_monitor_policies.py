"""Policies are pure functions of the state, and do what they say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import anytime
import compiler
from anytime import AnytimeError, Machine, Profile, ProfileLibrary
from anytime.recordings import Recording
from monitor import Decision, Energy, Mission, Situation, State, Value
from monitor.calibration import spread_of
from monitor.inter_frame import (
    Contracts,
    Spread,
    best_contract,
    compiled_contracts,
    foresee,
    pinned_contracts,
)
from monitor.intra_frame import keep_course
from monitor.policies import Expected, Informed, Paper, constant
from monitor.rhythms import Lived, Rhythm, rhythm_of

MISSION = Mission(Value("linear", 100, 200), Energy(0.2, 0.1, 0.03))
CONTRACTS = Contracts(
    ("see", "plan"),
    np.array([[0.5, 0.2], [2.0, 0.2], [6.0, 0.2]]),
    np.array([0.9, 0.9, 0.9]),
    np.array([[0.9, 1.0]] * 3),
)
RHYTHM = Rhythm(
    np.array([0.5, 6.0]),
    np.array([0.12, 0.07]),
    np.array([24.0, 17.0]),
    np.array([1.5, 1.0]),
    np.array([0.3, 0.0]),
    np.array([0.7, 0.95]),
)


def state(time=0.0, to_go=200.0, in_hand=0.0, energy=0.0, **changes) -> State:
    base = State("frame", time, Situation(energy, to_go, in_hand), standing=in_hand == 0)
    return replace(base, **changes)


def test_within_a_frame_the_expectation_changes_the_speed_and_nothing_else():
    policy = Expected(MISSION, CONTRACTS, RHYTHM, Spread((0.0,), ((0.8, 1.0, 1.5),)))
    begun = replace(policy(state()), speed=MISSION.speeds[0])
    late = state(150.0, 200.0, moment="call", contract=begun)
    changed = policy(late)
    assert changed.shares == begun.shares
    assert changed.speed == policy(replace(late, moment="frame")).speed
    assert changed.why is not None
    assert changed.why.case == "speed re-chosen"
    with pytest.raises(ValueError, match="a frame in progress has a contract"):
        policy(replace(late, contract=None))


@given(st.floats(0, 190), st.floats(0, 500), st.floats(0, 50), st.floats(0, 300))
def test_the_same_state_leads_to_the_same_decision_within_the_limits(time, to_go, in_hand, energy):
    for policy in (
        Paper(MISSION, CONTRACTS, RHYTHM),
        Expected(MISSION, CONTRACTS, RHYTHM, Spread((0.0,), ((0.8, 1.0, 1.5),))),
        constant({"see": 1.0, "plan": 0.2}, 4.0),
    ):
        asked = state(time, to_go, in_hand, energy)
        first, second = policy(asked), policy(asked)
        assert first == second
        assert MISSION.speeds[0] <= first.speed <= MISSION.speeds[1]
        assert set(first.shares) == {"see", "plan"}


def test_the_decision_is_the_best_of_all_contracts_and_speeds():
    asked = state()
    decision = best_contract(MISSION, CONTRACTS, RHYTHM, Spread(), asked)
    speeds = np.geomspace(*MISSION.speeds, 19)
    seconds, energy = foresee(MISSION, CONTRACTS, RHYTHM, asked, speeds)
    net = MISSION.value(seconds) - MISSION.energy.price * energy
    assert decision.why.net == pytest.approx(net.max())
    assert decision.why.net == pytest.approx(max(net for _, net in decision.why.curve))


@given(
    st.sampled_from([0.0, 1.0, 30.0, 200.0]),
    st.floats(0.0, 30.0),
    st.sampled_from([0, 1, 2]),
    st.floats(1.0, 9.0),
)
def test_what_is_foreseen_is_thinking_or_driving_whichever_is_longer_frame_by_frame(
    to_go, in_hand, row, speed
):
    mission = replace(MISSION, job=3.0, energy=replace(MISSION.energy, idle=0.05))
    contracts = replace(CONTRACTS, efficiency=np.array([0.5, 0.8, 0.9]))
    asked = state(to_go=to_go, in_hand=in_hand)
    seconds, energy = foresee(mission, contracts, RHYTHM, asked, np.array([speed]))
    sensing, contract = contracts.shares[row, 0], contracts.shares[row].sum()
    often, far, stops = (float(each[0]) for each in RHYTHM.at(np.array([sensing])))
    frames, drive = often * to_go, far / contracts.efficiency[row] / speed
    walk = RHYTHM.stretched(in_hand, asked.made_on) / speed
    lasts = max(contract, walk) if to_go > 0 else walk  # the first plan is made meanwhile
    if frames > 1:
        lasts += (frames - 1) * max(contract, drive)  # the next plan is made meanwhile
    lasts += min(frames, 1.0) * drive  # after the last there is none to make
    lasts += frames * stops * contract + mission.job
    moves = walk + frames * drive
    assert seconds[row, 0] == pytest.approx(lasts)
    idle = mission.energy.idle * (lasts - moves)
    assert energy[row, 0] == pytest.approx(moves * mission.energy.power(speed) + idle)


def test_what_a_contract_makes_of_its_plans_is_a_share_that_more_time_never_lessens():
    from experiments import crossings

    contracts = compiled_contracts(crossings.compiled())
    assert ((contracts.efficiency >= 0.05) & (contracts.efficiency <= 1.0)).all()
    assert contracts.efficiency[0] < 0.9
    assert contracts.efficiency[-1] == contracts.efficiency.max()
    assert (contracts.probes >= contracts.efficiency[:, None] - 0.05).all()


def test_pinned_contracts_sense_as_little_or_as_long_as_is_of_use_and_plan_as_they_like():
    from experiments import crossings

    program = crossings.compiled()
    least, most = (pinned_contracts(program, extreme) for extreme in ("min", "max"))
    assert set(least.shares[:, 0]) == {program.tables[0].first}
    assert set(most.shares[:, 0]) == {program.tables[0].saturation}
    for contracts in (least, most):
        planning = contracts.shares[:, 1]
        assert (np.diff(planning) > 0).all()
        assert planning[0] > 0
        assert planning[-1] <= program.tables[1].times[-1]
        assert 5 < len(planning) <= 24


@anytime.module()
def look(image):
    yield image


@anytime.module()
def match(seen):
    yield seen


@anytime.module()
def plan(matched):
    yield matched


@compiler.program
def look_match_plan(image):
    return plan(match(look(image)))


def of_four_problems(name, inputs, times, qualities):
    """Runs on inputs of quality .4 and 1, whose results are as good as their inputs allow."""
    seconds, raw = np.array(times), np.array(qualities)
    none, end = np.full(len(times), np.nan), (9.0, 9.0)
    return Profile(
        name,
        inputs,
        tuple(
            Recording(
                f"p{problem}",
                name,
                dict.fromkeys(inputs, given),
                {},
                seconds,
                seconds,
                given * raw,
                none,
                end,
                True,
            )
            for problem in range(4)
            for given in (0.4, 1.0)
        ),
    )


def of_three_calls(plans):
    """A program whose last call has results of these qualities, the first of them at once."""
    profiles = {
        "look": of_four_problems("look", (), [1.0, 2.0], [0.4, 1.0]),
        "match": of_four_problems("match", ("seen",), [0.5, 2.5], [0.5, 0.9]),
        "plan": of_four_problems("plan", ("matched",), [0.0, 1.5, 2.5], plans),
    }
    library = ProfileLibrary(profiles=profiles, machine=Machine("lab"))
    return compiler.compile(look_match_plan, library)


@pytest.fixture(scope="module")
def three_calls():
    return of_three_calls([0.5, 0.4, 0.9])


def test_of_three_calls_the_last_plans_as_long_as_is_of_use_and_no_longer(three_calls):
    for extreme in ("min", "max"):
        contracts = pinned_contracts(three_calls, extreme)
        assert contracts.labels == ("look", "match", "plan")
        assert contracts.shares[:, 2].tolist() == [1e-9, 2.5]  # no call is run without time
        (pinned,) = np.unique(contracts.shares[:, :2], axis=0)
        assert pinned.tolist() == {"min": [1.0, 0.5], "max": [2.0, 2.5]}[extreme]


def test_a_tenth_more_that_reaches_no_later_result_is_worth_nothing(three_calls):
    contracts = pinned_contracts(three_calls, "min")
    assert contracts.probes == pytest.approx(np.tile(contracts.efficiency[:, None], 3))
    # the first plan, at once, is worth .5, and the last .9, each times what was seen and matched
    assert contracts.efficiency.tolist() == pytest.approx([5 / 9, 1.0])


@pytest.mark.parametrize(
    ("plans", "efficiency"), [([0.9, 0.8, 0.3], [1.0]), ([0.01, 0.01, 0.9], [0.05, 1.0])]
)
def test_no_plan_makes_a_frame_longer_than_twentyfold_or_shorter_than_the_best(plans, efficiency):
    contracts = pinned_contracts(of_three_calls(plans), "min")
    assert contracts.efficiency.tolist() == pytest.approx(efficiency)


def test_unless_it_was_lived_a_second_foreseen_is_a_second():
    assert Spread() == Spread((0.0,), ((1.0,),))


def test_the_contracts_reach_from_the_least_to_the_best_that_was_compiled(three_calls):
    from experiments import crossings

    for program in (three_calls, crossings.compiled()):
        budgets = program.frontier.budgets
        contracts = compiled_contracts(program)
        assert contracts.seconds[[0, -1]] == pytest.approx(budgets[[0, -1]])
        assert len(contracts.seconds) == min(len(budgets), 24)


def test_where_driving_takes_longer_than_thinking_better_planning_has_a_price():
    slow = replace(MISSION, speeds=(1.0, 1.0))
    prices = best_contract(slow, CONTRACTS, RHYTHM, Spread(), state()).why.prices
    assert set(prices) == {"see", "plan"}
    assert prices["plan"] > 0
    fast = replace(MISSION, speeds=(50.0, 50.0))
    assert best_contract(fast, CONTRACTS, RHYTHM, Spread(), state()).why.prices["see"] < 0


@pytest.mark.parametrize("to_go", [30.0, 200.0])
def test_a_price_is_what_a_second_more_for_that_call_would_add(to_go):
    asked = state(to_go=to_go)
    decision = best_contract(MISSION, CONTRACTS, RHYTHM, Spread(), asked)
    row = CONTRACTS.shares.tolist().index([*decision.shares.values()])
    more = 0.1 * CONTRACTS.seconds[row]
    for place, label in enumerate(CONTRACTS.labels):
        shares = CONTRACTS.shares[row] + more * np.eye(2)[place]
        probes = CONTRACTS.probes[row]
        alone = Contracts(CONTRACTS.labels, shares[None], probes[[place]], probes[None])
        gain = best_contract(MISSION, alone, RHYTHM, Spread(), asked).why.net - decision.why.net
        assert decision.why.prices[label] == pytest.approx(gain / more)


def test_a_contract_of_no_time_has_no_prices():
    none = Contracts(("see",), np.zeros((1, 1)), np.ones(1), np.ones((1, 1)))
    assert best_contract(MISSION, none, RHYTHM, Spread(), state()).why.prices == {"see": 0.0}


def test_the_spread_is_the_one_of_the_time_that_would_be_left_without_it():
    asked = state()
    plain = best_contract(MISSION, CONTRACTS, RHYTHM, Spread(), asked)
    late = best_contract(MISSION, CONTRACTS, RHYTHM, Spread((0.0,), ((1.0, 1.8),)), asked)
    left = plain.why.seconds
    for beyond, expected in ((0.99 * left, late), (1.01 * left, plain)):
        spread = Spread((0.0, beyond), ((1.0,), (1.0, 1.8)))
        assert best_contract(MISSION, CONTRACTS, RHYTHM, spread, asked) == expected
    assert late.why.net < plain.why.net


@given(st.floats(1, 400), st.floats(1, 50))
def test_a_longer_way_or_a_later_hour_never_promises_more(to_go, later):
    def promise(asked):
        return best_contract(MISSION, CONTRACTS, RHYTHM, Spread(), asked).why.net

    assert promise(state(to_go=to_go + later)) <= promise(state(to_go=to_go)) + 1e-9
    assert promise(state(time=later)) <= promise(state()) + 1e-9


@pytest.mark.parametrize(
    ("seen", "in_hand", "case"),
    [
        (0.9, 40.0, "faster"),  # planning ahead, execution behind
        (0.1, 4.0, "slower"),  # planning behind, execution ahead
        (0.9, 4.0, "keep course"),
        (0.1, 40.0, "keep course"),
    ],
)
def test_the_four_cases_of_the_paper(seen, in_hand, case):
    contract = Decision({"see": 2.0, "plan": 2.0}, 4.0)
    now = state(2.0, in_hand=in_hand, moment="call", contract=contract, advertised=0.5, seen=seen)
    decided = keep_course(MISSION, now)
    assert decided.why.case == case
    assert np.sign(decided.speed - 4.0) == {"faster": 1, "slower": -1, "keep course": 0}[case]


def on_course(contract=4.0, late=0.0, **seen):
    """Half of a contract has gone; execution ends late by this share of it."""
    decision = Decision({"see": contract / 2, "plan": contract / 2}, 4.0)
    in_hand = 4.0 * (contract / 2 + contract * late)
    return state(contract / 2, in_hand=in_hand, moment="call", contract=decision, **seen)


@given(st.floats(0.1, 1.0), st.floats(0.1, 1.0), st.sampled_from([0.25, 1.0, 4.0]))
def test_the_change_of_speed_is_the_gain_times_the_deviation(gain, deviation, contract):
    mission = replace(MISSION, gain=gain, speeds=(0.1, 100.0))
    behind = on_course(contract, deviation, advertised=0.5, seen=0.9)
    assert keep_course(mission, behind).speed == pytest.approx(4.0 * (1 + gain * deviation))
    early = deviation / 2  # nobody can be ahead by more than the half that is left
    ahead = on_course(contract, -early, advertised=0.5, seen=0.1)
    assert keep_course(mission, ahead).speed == pytest.approx(4.0 * (1 - gain * early))


def test_a_deviation_counts_no_more_than_a_contract_and_never_stops_the_robot():
    mission = replace(MISSION, gain=1.0, speeds=(0.1, 100.0))
    far_behind = on_course(late=3.0, advertised=0.5, seen=0.9)
    assert keep_course(mission, far_behind).speed == 8.0
    at_the_goal = replace(
        on_course(advertised=0.5, seen=0.1), time=0.0, situation=Situation(0.0, 9.0, 0.0)
    )
    assert keep_course(mission, at_the_goal).speed == pytest.approx(0.4)


def test_the_change_of_speed_stays_within_the_limits():
    mission = replace(MISSION, gain=1.0, speeds=(3.5, 4.5))
    assert keep_course(mission, on_course(late=0.9, advertised=0.5, seen=0.9)).speed == 4.5
    assert keep_course(mission, on_course(late=-0.4, advertised=0.5, seen=0.1)).speed == 3.5


def test_a_contract_of_no_time_stands():
    contract = Decision({"see": 0.0}, 4.0)
    asked = state(in_hand=4.0, moment="call", contract=contract, advertised=0.5, seen=0.9)
    assert keep_course(MISSION, asked) is contract


def test_who_is_neither_ahead_nor_behind_keeps_course():
    for seen in (0.1, 0.5, 0.9):
        assert keep_course(MISSION, on_course(advertised=0.5, seen=seen)).why.case == "keep course"
    as_advertised = on_course(late=0.5, advertised=0.5, seen=0.5)
    assert keep_course(MISSION, as_advertised).why.case == "faster"


@pytest.mark.parametrize("seen", [{"advertised": 0.5}, {"seen": 0.9}, {}])
def test_where_nothing_was_advertised_or_seen_the_contract_stands(seen):
    asked = on_course(late=1.0, **seen)
    assert keep_course(MISSION, asked) is asked.contract


def test_the_gain_is_a_parameter_of_the_mission():
    contract = Decision({"see": 2.0, "plan": 2.0}, 4.0)
    now = state(2.0, in_hand=40.0, moment="call", contract=contract, advertised=0.5, seen=0.9)
    assert keep_course(replace(MISSION, gain=0.0), now).speed == 4.0
    assert keep_course(MISSION, now).speed > 4.0


def test_rhythm_is_taken_from_missions_and_more_sensing_never_means_more_walking():
    lived = [
        Lived(0.5, 100, 210, 150, 11, 3, 0.7),
        Lived(2.0, 100, 215, 160, 10, 2, 0.8),  # worse by chance
        Lived(6.0, 100, 120, 118, 7, 0, 0.9),
    ]
    rhythm = rhythm_of(lived)
    walked = rhythm.frames * rhythm.length
    assert (np.diff(walked) <= 1e-12).all()
    assert walked[-1] == pytest.approx(1.2)
    assert rhythm.stretched(10.0, 6.0) == pytest.approx(10 * 120 / 118)


def test_the_spread_is_the_quantiles_of_real_over_foreseen():
    mission = [(200.0, 200.0)] * 10 + [(100.0, 90.0)] * 10 + [(10.0, 12.0)] * 10
    spread = spread_of([mission] * 3)
    assert spread.at(5.0) == pytest.approx(1.2)
    assert spread.at(100.0) == pytest.approx(0.9)
    assert spread.at(1e9) == pytest.approx(1.0)
    assert spread_of([]) == Spread()


def test_what_a_mission_promises_at_its_beginning_is_held_against_whole_missions():
    mission = [(100.0, 130.0)] + [(90.0 - index, 90.0 - index) for index in range(80)]
    spread = spread_of([mission] * 10)
    assert spread.at(100.0) == pytest.approx(1.3)
    assert spread.at(85.0) == pytest.approx(1.0)


def test_nobody_decides_by_news_before_it_comes():
    slow, brisk = (constant({"see": 1.0}, speed) for speed in (1.0, 5.0))
    informed = Informed(20.0, slow, brisk)
    speeds = [
        informed(State("frame", time, Situation(0.0, 40.0, 0.0), standing=True)).speed
        for time in (0.0, 19.9, 20.0, 50.0)
    ]
    assert speeds == [1.0, 1.0, 5.0, 5.0]


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_constant_speed_moves(speed):
    with pytest.raises(AnytimeError, match="speed"):
        constant({"see": 1.0}, speed)


@pytest.mark.parametrize("seconds", [-0.1, float("nan"), float("inf")])
def test_a_constant_share_is_a_time(seconds):
    assert constant({"see": 0.0}, 1.0).decision.shares == {"see": 0.0}
    with pytest.raises(AnytimeError, match="see gets"):
        constant({"see": seconds}, 1.0)
