"""What all tests share: Hypothesis without a clock, and the same examples every time."""

from hypothesis import settings

settings.register_profile("laws", deadline=None, derandomize=True)
settings.load_profile("laws")
