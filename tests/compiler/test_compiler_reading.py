"""Reading programs: what is understood, and how the rest is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

import anytime
import compiler
from anytime import AnytimeError
from anytime.programs import Call, Constant, Input, Program, upstream


@anytime.module(quality=lambda value: 1.0)
def see(image):
    yield image


@anytime.module(quality=lambda value: 1.0)
def find(boxes, goal):
    yield boxes


@anytime.module(quality=lambda value: 1.0)
def merge(one, other):
    yield one


def read(function) -> Program:
    return compiler.program(function)


def test_a_chain_is_read_in_the_order_of_its_calls():
    @compiler.program
    def navigate(image, goal):
        return find(see(image), goal)

    assert navigate.name == "navigate"
    assert navigate.inputs == ("image", "goal")
    assert [call.label for call in navigate.calls] == ["see", "find"]
    assert navigate.output is navigate.calls[-1]
    assert upstream(navigate.output) == {"boxes": navigate.calls[0]}
    assert repr(navigate) == "program navigate(image, goal) = find(see(image), goal)"


def test_a_result_used_twice_is_one_node_and_two_equal_calls_are_two():
    @compiler.program
    def shared(image):
        seen = see(image)
        return merge(seen, seen)

    @compiler.program
    def separate(image):
        return merge(see(image), see(image))

    assert [call.label for call in shared.calls] == ["see", "merge"]
    assert shared.output.arguments[0] is shared.output.arguments[1]
    assert [call.label for call in separate.calls] == ["see", "see_2", "merge"]
    assert separate.call("see") is not separate.call("see_2")
    with pytest.raises(AnytimeError, match="no call 'look'; it has see, see_2, merge"):
        separate.call("look")


def test_a_numbered_label_does_not_hide_a_module_of_that_name():
    @anytime.module(name="see_2")
    def other(image):
        yield image

    @compiler.program
    def clash(image):
        return merge(see(image), merge(other(image), see(image)))

    assert [call.label for call in clash.calls] == ["see", "see_2", "see_3", "merge", "merge_2"]


def test_plain_values_are_constants():
    @compiler.program
    def fixed(image):
        return find(see(image), (3, 4))

    boxes, goal = fixed.output.arguments
    assert isinstance(boxes, Call)
    assert isinstance(goal, Constant)
    assert goal.value == (3, 4)


def test_a_lone_module_is_a_program_with_inputs_of_its_parameters():
    from anytime.programs import program_of

    alone = program_of(find)
    assert alone.inputs == ("boxes", "goal")
    assert [type(argument) for argument in alone.output.arguments] == [Input, Input]


def takes_an_item(image):
    return see(image[0])


def takes_an_item_of_a_result(image):
    return find(see(image)[0], image)


def takes_an_attribute(image):
    return see(image.left)


def branches(image, goal):
    return find(see(image), goal) if goal else see(image)


def negates(image):
    return see(not image)


def compares(image, goal):
    return see(image) if image == goal else see(goal)


def compares_with_a_number(image):
    return see(image) if image != 3 else see(0)


def orders(image, goal):
    return see(image) if image < goal else see(goal)


def adds(image, goal):
    return find(see(image), goal + 1)


def adds_to(image, goal):
    return find(see(image), 1 + goal)


def negative(image):
    return see(-image)


def power(image):
    return see(image**2)


def iterates(image):
    return see([part for part in image])  # noqa: C416


def measures_length(image):
    return see(image) if len(image) else see(0)


def contains(image):
    return see(image) if 3 in image else see(0)


def unpacks(image):
    one, other = see(image)
    return merge(one, other)


def calls_an_input(image):
    return see(image())


def converts(image):
    return see(float(image))


def returns_an_input(image):
    see(image)
    return image


def returns_nothing(image):
    see(image)


def forgets_a_call(image, goal):
    see(goal)
    return see(image)


def gives_too_little(image):
    return find(see(image))


def gives_too_much(image):
    return see(image, image)


def starred(*images):
    return see(images)


def by_keyword(*, image):
    return see(image)


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (takes_an_item, r"takes item 0 of image, .* do it inside a module"),
        (takes_an_item_of_a_result, r"takes item 0 of see\(image\)"),
        (takes_an_attribute, r"takes attribute \.left of image"),
        (branches, r"branches on \(or negates\) goal"),
        (negates, r"branches on \(or negates\) image"),
        (compares, r"compares image"),
        (compares_with_a_number, r"compares image"),
        (orders, r"computes with image"),
        (adds, r"computes with goal"),
        (adds_to, r"computes with goal"),
        (negative, r"computes with image"),
        (power, r"computes with image"),
        (iterates, r"iterates over image"),
        (measures_length, r"computes with image"),
        (contains, r"computes with image"),
        (unpacks, r"iterates over see\(image\)"),
        (calls_an_input, r"calls image, .* only modules"),
        (converts, r"computes with image"),
        (returns_an_input, r"returns image, which no module makes"),
        (returns_nothing, r"returns None; return the result of a module"),
        (forgets_a_call, r"result of see\(goal\) is never used"),
        (gives_too_little, r"calls find with 1 arguments; it takes 2: boxes, goal"),
        (gives_too_much, r"calls see with 2 arguments; it takes 1: image"),
        (starred, r"give 'images' as an ordinary parameter"),
        (by_keyword, r"give 'image' as an ordinary parameter"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_place_and_cure(function, says):
    with pytest.raises(AnytimeError, match=says) as caught:
        read(function)
    assert f"{__file__}:{function.__code__.co_firstlineno}: program" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_modules_of_one_name_are_refused():
    @anytime.module(name="see")
    def impostor(image):
        yield image

    def both(image):
        return merge(see(image), impostor(image))

    with pytest.raises(AnytimeError, match="two different modules are named 'see'"):
        read(both)


def test_a_module_is_no_program_and_a_program_no_module():
    with pytest.raises(AnytimeError, match="see is a module"):
        read(see)

    @compiler.program
    def navigate(image):
        return see(image)

    with pytest.raises(AnytimeError, match=r"navigate is a program: compile it"):
        navigate("an image")
    with pytest.raises(AnytimeError, match="compile takes a program"):
        compiler.compile(len, {})  # pyright: ignore[reportArgumentType]


def test_reading_that_failed_leaves_modules_as_they_were():
    with pytest.raises(AnytimeError):
        read(adds)
    assert anytime.run(see, "image", seconds=10).value == "image"


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (lambda a, b: find([a], b), "calls find with a inside a list"),
        (lambda a, b: find({"deep": [(a,)]}, b), "calls find with a inside a dict"),
        (lambda a, b: find(f"{a}.png", b), "writes out a"),
        (lambda a, b: find(str(a), b), "writes out a"),
        (lambda a, b: find(np.asarray(a), b), "computes with a"),
        (lambda a, b: find(a & b, b), "computes with a"),
        (lambda a, b: find(~a, b), "computes with a"),
        (lambda a, b: find(round(a), b), "computes with a"),
        (lambda a, b: find([1, 2][a], b), "computes with a"),
        (lambda a, b: find(a, goals=b), "find is called with goals=…; by name it takes goal"),
        (lambda a, b=2: find(a, b), "'b' has a default"),
        (lambda a, clock: find(a, clock), "the input 'clock' has the name"),
    ],
)
def test_what_hides_a_symbol_or_computes_with_it_is_refused_with_its_place(body, reason):
    with pytest.raises(AnytimeError, match=re.escape(reason)) as caught:
        compiler.program(body)
    assert "test_compiler_reading.py" in str(caught.value)


@pytest.mark.parametrize("what", [3, "words", Program])
def test_only_a_function_is_read(what):
    with pytest.raises(AnytimeError, match="program takes a function that calls modules, not"):
        compiler.program(what)


def test_inputs_may_be_given_by_name():
    @compiler.program
    def navigate(image, goal):
        return find(goal=goal, boxes=see(image=image))

    assert repr(navigate.output) == "find(see(image), goal)"
