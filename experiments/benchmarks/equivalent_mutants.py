"""Changes of the program that change nothing that can be seen, each with the reason why.

By module, then by the line and the change. A test looks whether each is still there.
"""

from __future__ import annotations

EQUIVALENT: dict[str, dict[tuple[str, str], str]] = {}
