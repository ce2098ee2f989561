"""What driver and simulator must call by the same name, because NAOqi does."""

FALLEN = "robotHasFallen"
"""The key, and the event, that is 1 when the robot has fallen."""

SONARS = tuple(f"Device/SubDeviceList/US/{side}/Sensor/Value" for side in ("Left", "Right"))
"""The keys of the sonars, in metres; 0 is an error."""

NO_ECHO = 5.0
"""Metres from which on a sonar tells that it hears nothing."""
