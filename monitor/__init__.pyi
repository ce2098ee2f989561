"""The monitor: spends a mission's time frame by frame, and says why."""

from .bodies import Robot
from .endings import Ending
from .missions import Energy, Mission, News, Value
from .monitoring import Monitor
from .reports import Frame, Report
from .states import Decision, Situation, State

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
