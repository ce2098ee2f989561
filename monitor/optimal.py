"""The policy of tables: the course that is worth most from here on, and the best speed now."""

from __future__ import annotations

from dataclasses import dataclass, replace

from monitor.course_tables import CourseTable
from monitor.missions import Mission
from monitor.states import Decision, State, Why


@dataclass(frozen=True)
class Optimal:
    """Chooses the course as if it were kept to the end, and again in each frame; the speed as if
    it were chosen anew in each frame, as it is.

    The state of its tables is what is still to be walked, foreseen from the route that is left and
    from what was walked. So when the estimate of the world changes, the look-up is elsewhere in
    them, and nothing is to be solved again.
    """

    mission: Mission
    labels: tuple[str, ...]
    tables: tuple[CourseTable, ...]

    def __call__(self, state: State) -> Decision:
        if state.moment == "call" and state.contract is not None:
            return self.walk_on(state, state.contract)
        found = [self.worth(table, state, table.course.contract) for table in self.tables]
        index = max(range(len(found)), key=lambda at: found[at][0])
        worth, speed, to_walk = found[index]
        shares = self.tables[index].course.shares
        spent = self.mission.energy.price * state.situation.energy
        curve = tuple(
            (sum(table.course.shares), row[0] - spent)
            for table, row in zip(self.tables, found, strict=True)
        )
        why = Why(worth, spent, to_walk / speed, curve, "table")
        return Decision(dict(zip(self.labels, shares, strict=True)), speed, why)

    def walk_on(self, state: State, contract: Decision) -> Decision:
        """The same contract and the best speed for the rest of the frame.

        What lies beyond the end of the plan is a detour of unknown length: the speed stays.
        """
        if state.situation.in_hand <= 0:
            return contract
        table = self._nearest(contract.shares[self.labels[0]])
        passed = state.time - state.frame_started
        _, speed, _ = self.worth(table, state, max(table.course.contract - passed, 0.0))
        return replace(contract, speed=speed, why=replace(contract.why, case="speed re-chosen"))

    def worth(
        self, table: CourseTable, state: State, thinking: float
    ) -> tuple[float, float, float]:
        """(net value to expect of a course from here on, best speed, length to be walked)."""
        situation = state.situation
        left = situation.to_go + situation.in_hand
        whole = table.course.forecast.whole
        walked = state.walked * whole / self._nearest(state.walked_on).course.forecast.whole
        to_walk = table.course.forecast(left, walked, state.route)
        if state.standing or situation.in_hand <= 0:  # a plan of no length is soon over
            slow, fast = self.mission.speeds
            return table.standing(state.time + thinking, to_walk), (slow * fast) ** 0.5, to_walk
        made_on = self._nearest(state.made_on).course
        return (
            *table.walking(state.time, to_walk, situation.in_hand, thinking, made_on),
            to_walk,
        )

    def _nearest(self, sensing: float) -> CourseTable:
        return min(self.tables, key=lambda table: abs(table.course.shares[0] - sensing))
