"""The command `anytime tour`."""

import argparse

from anytime.command_line import Answer, add_command, natural, positive


def declare(commands):
    """Declare the sub-commands; heavy imports wait until one is run."""
    parser = add_command(commands, "tour", tour, "a short tour through random places")
    parser.add_argument("--seed", type=natural, default=0, help="of the places")
    parser.add_argument("--seconds", type=positive, default=0.1, help="to shorten it")


def tour(options: argparse.Namespace) -> Answer:
    """Shorten a tour for a while."""
    import anytime
    import numpy as np

    from anytime_tours.shortening import length, shorten, some_places

    problem = next(some_places(np.random.default_rng(options.seed)))
    found = anytime.run(shorten, problem.places, seconds=options.seconds)
    metres = length(found.value, problem)
    return Answer(f"{found!r}\n{metres:.2f} m", {"metres": metres, "tour": list(found.value)})
