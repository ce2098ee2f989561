"""The monitor: spends a mission's time frame by frame, and says why."""

from monitor.bodies import Robot
from monitor.endings import Ending
from monitor.missions import Energy, Mission, News, Value
from monitor.monitoring import Monitor
from monitor.reports import Frame, Report
from monitor.states import Decision, Situation, State

__all__ = [
    "Decision",
    "Ending",
    "Energy",
    "Frame",
    "Mission",
    "Monitor",
    "News",
    "Report",
    "Robot",
    "Situation",
    "State",
    "Value",
]
