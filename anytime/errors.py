"""What a user did wrong, in one line that says what would be right."""


class AnytimeError(ValueError):
    """Bad input: the message names what was wrong and what would be right."""


class OutsideRunError(RuntimeError):
    """`register`, `expired` or `charge` was called where no module runs, or after its run."""
