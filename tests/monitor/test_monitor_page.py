"""The replay page, as text and as a browser shows it."""

from __future__ import annotations

import json
import re
import socket
import threading
import urllib.error
import urllib.request
from dataclasses import replace
from itertools import pairwise

import pytest
from msgspec.structs import replace as replace_struct

from anytime.__main__ import main
from anytime.errors import AnytimeError
from monitor.endings import Ending
from monitor.logs import LogWriter, read_log, write_log
from monitor.missions import News, Value
from monitor.page import page_data, render, write_page
from monitor.page.losses import costliest, waterfall
from monitor.regrets import Fork, Regret, log_regrets
from monitor.serving import serve

QUESTIONS = ("why", "fixed", "losses", "profile", "price")


@pytest.fixture
def logs(tmp_path, mission, floor, made_up):
    """The same mission by three policies."""
    return [
        read_log(write_log(tmp_path / f"{policy}.jsonl", mission, floor, made_up(frames, policy)))
        for policy, frames in (("expected", 6), ("min", 9), ("fixed", 7))
    ]


def test_the_page_needs_nothing_from_elsewhere(logs):
    page = render(logs[0])
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:)""", page)
    assert "url(" not in page.replace("url(#", "")
    assert "default-src 'none'" in page


def test_names_in_a_log_cannot_become_code(tmp_path, mission, floor, report):
    evil = "</script><script>alert(1)</script>{{code}}"
    told = replace(report, policy=evil, fault=evil)
    log = read_log(write_log(tmp_path / "a.jsonl", replace(mission, name=evil), floor, told))
    page = render(log)
    assert page.count("</script>") == 2
    assert "<script>alert" not in page


def test_the_same_log_gives_the_same_page(logs, tmp_path):
    assert render(logs[0]) == render(logs[0])
    page = write_page(logs, tmp_path / "all.html", summary="<table></table>")
    assert '<section id="summary"><table></table></section>' in page.read_text()


def test_the_waterfall_adds_up(logs):
    for log in logs:
        steps = waterfall(log)
        assert steps[0].after == log.mission.worth(0.0)
        for one, next_one in pairwise(steps[:-1]):
            assert next_one.before == pytest.approx(one.after)
        assert steps[-1].after == pytest.approx(steps[-2].after)
        assert steps[-1].after == pytest.approx(log.net, abs=1e-6)


def test_what_became_known_on_the_way_is_not_put_down_to_driving(tmp_path, mission, floor, report):
    worth, last = float(mission.value.worth), report.frames[-1].ended
    late = replace(report, seconds=last + 1.0)  # of a job after the last frame
    for at, lived in ((last + 0.5, late), (0.5 * last, report)):
        told = replace(mission, news=News(at, Value("linear", 2.0 * worth, mission.value.seconds)))
        log = read_log(write_log(tmp_path / f"{at}.jsonl", told, floor, lived))
        steps = {step.name: step for step in waterfall(log)}
        assert steps["news"].size == pytest.approx(told.news.value(at) - told.value(at))
        assert steps["drive"].size <= 0.0
        assert steps["wait"].size <= 0.0
    losses = page_data([log])["runs"][0]["losses"]
    assert "What became known on the way added" in losses


def test_missions_that_share_a_policy_are_told_apart(tmp_path, mission, floor, made_up):
    logs = [
        read_log(write_log(tmp_path / f"{seed}.jsonl", mission, floor, replace(told, seed=seed)))
        for seed, told in enumerate((made_up(3, "min"), made_up(4, "min")))
    ]
    names = [run["name"] for run in page_data(logs)["runs"]]
    assert names == ["min, seed 0", "min, seed 1"]
    assert len({run["name"] for run in page_data([*logs, logs[0]])["runs"]}) == 3


def test_one_result_is_no_verdict(tmp_path, mission, floor, made_up):
    log = read_log(write_log(tmp_path / "a.jsonl", mission, floor, made_up(3, "min")))
    call = replace_struct(log.frames[0].calls[0], advertised=0.5, estimate=0.9)
    frame = replace_struct(log.frames[0], calls=(call,))
    told = page_data([replace(log, frames=(frame,))])["runs"][0]["profile"]
    assert told.startswith("One result says little: .50 advertised, .90 seen")


def test_a_mission_that_was_not_reached_earns_nothing(tmp_path, mission, floor, report):
    told = replace(report, ending=Ending.BLOCKED, earned=0.0, net=-0.2 * report.energy)
    log = read_log(write_log(tmp_path / "a.jsonl", mission, floor, told))
    steps = {step.name: step for step in waterfall(log)}
    assert steps["not reached"].after == 0.0
    assert steps["net"].after == pytest.approx(told.net)


def test_what_the_frames_lost_is_what_was_promised_and_not_kept(logs):
    for log in logs:
        lost = sum(loss.total for loss in costliest(log))
        assert lost == pytest.approx(log.promised - log.net)


def test_the_costliest_frame_is_the_one_after_which_least_was_foreseen(logs):
    log = logs[0]
    assert costliest(log)[0].index == 2
    assert costliest(log)[0].total == pytest.approx(4.0)


def test_without_foresight_the_costliest_frame_used_up_most(logs):
    moments = [replace_struct(frame.moments[0], curve=()) for frame in logs[0].frames]
    frames = [
        replace_struct(frame, moments=(moment,))
        for frame, moment in zip(logs[0].frames, moments, strict=True)
    ]
    worst = costliest(replace(logs[0], frames=tuple(frames)))[0]
    assert worst.index == 2
    assert worst.total == worst.used


def test_each_question_is_answered_with_a_number(logs):
    run = page_data(logs)["runs"][0]
    for frame in run["frames"]:
        for moment in frame["moments"]:
            for answer in (moment["why"], moment["fixed"], moment["price"], moment["headline"]):
                assert re.search(r"\d", answer), answer
    assert re.search(r"\d", run["losses"])
    assert re.search(r"\d", run["profile"])


def test_the_sentence_says_what_more_thinking_would_have_gained(logs):
    sentence = page_data(logs)["runs"][0]["frames"][1]["moments"][0]["headline"]
    assert sentence == (
        "Gave see 700 ms and find_path 300 ms, drove at 4.00 cells/s: 0.5 s more would lose 6.50."
    )


def test_without_a_fixed_mission_the_page_says_how_to_get_one(logs):
    alone = page_data(logs[:1])["runs"][0]["frames"][1]["moments"][0]["fixed"]
    assert "[fixed] in its file, or a log of policy fixed on the same seed" in alone
    beside = page_data(logs)["runs"][0]["frames"][1]["moments"][0]["fixed"]
    assert "Fixed would have given see 700 ms and find_path 300 ms" in beside


def test_prices_that_were_logged_name_who_pays(tmp_path, mission, floor, report):
    first, *others = report.frames[0].moments
    why = replace(first.decision.why, prices={"see": 0.4, "find_path": 2.5})
    priced = replace(first, decision=replace(first.decision, why=why))
    with LogWriter(tmp_path / "a.jsonl") as writer:
        writer.mission(mission, policy="expected", seed=3, labels=("see", "find_path"), floor=floor)
        writer.frame(replace(report.frames[0], moments=(priced, *others)))
    moment = page_data([read_log(writer.path)])["runs"][0]["frames"][0]["moments"][0]
    assert moment["price"].startswith("find_path pays most for another millisecond")


def test_regrets_stand_behind_the_end_of_a_log_and_are_told_in_numbers(
    tmp_path, mission, floor, report
):
    path = write_log(tmp_path / "a.jsonl", mission, floor, report)
    bare = page_data([read_log(path)])["runs"][0]
    assert (bare["regretted"], bare["frames"][0]["forks"]) == ("", None)
    other = {"see": 0.2, "find_path": 0.3}
    log_regrets(
        path,
        tuple(
            Regret(
                index, report.net, (Fork(other, 4.0, report.net + index - 4), Fork(other, 5.0, 1.0))
            )
            for index in range(6)
        ),
    )
    run = page_data([read_log(path)])["runs"][0]
    assert run["regretted"].startswith("12 missions were lived again")
    assert "most in frame 5, 1.00; in 5 of 6 frames none was better" in run["regretted"]
    assert [frame["forks"]["regret"] for frame in run["frames"]] == pytest.approx([0] * 5 + [1.0])
    assert "see 200 ms would have ended at" in run["frames"][5]["here_regretted"]
    log_regrets(path, (Regret(0, 1.0, (Fork(other, 4.0, 1.0),)),))
    with pytest.raises(AnytimeError, match="follow the end, one for each frame in order"):
        read_log(path)


def test_a_log_without_frames_or_map_still_makes_a_page(tmp_path, mission, report):
    with LogWriter(tmp_path / "a.jsonl") as writer:
        writer.mission(mission, policy="expected", seed=3, labels=("see",))
        assert "0 frames so far" in render(read_log(writer.path))
        writer.frame(replace(report.frames[1], index=0, story={}))
        assert "under way" in render(read_log(writer.path))


@pytest.mark.browser
@pytest.mark.parametrize("width", [360, 1400])
def test_the_page_fits_and_answers_five_questions(browser, logs, tmp_path, width):
    page = write_page(logs, tmp_path / "page.html")
    browser.errors.clear()
    browser.open(page.as_uri(), width)
    for name in QUESTIONS:
        answer = browser.run(f"document.getElementById('{name}').textContent")
        assert re.search(r"\d", answer), (name, answer)
    for frame in range(6):
        browser.run(f"location.hash = '#{frame}'")
        browser.wait(f"document.getElementById('where').textContent.startsWith('Frame {frame},')")
        assert browser.run("document.scrollingElement.scrollWidth <= innerWidth")
    assert browser.errors == []


@pytest.mark.browser
def test_it_opens_at_the_costliest_decision_and_keys_lead_on(browser, logs, tmp_path):
    def where() -> str:
        return browser.run("document.getElementById('where').textContent")

    page = write_page(logs[:1], tmp_path / "page.html")
    browser.errors.clear()
    browser.open(page.as_uri())
    assert where().startswith("Frame 2, 6 in all")
    browser.press("ArrowRight")
    assert where().startswith("Frame 3, 6 in all")
    browser.press("ArrowLeft")
    browser.press("d")
    assert where().startswith("Frame 2, 6 in all")
    assert "decision 2 of 2" in where()
    browser.press("d")
    assert where().startswith("Frame 3, 6 in all")
    worst = [loss.index for loss in costliest(logs[0])]
    browser.run("location.hash = '#2'")
    browser.wait("document.getElementById('where').textContent.startsWith('Frame 2,')")
    browser.press("l")
    assert where().startswith(f"Frame {worst[1]}, 6 in all")
    browser.open(page.as_uri() + "#4")
    assert where().startswith("Frame 4, 6 in all")
    assert browser.errors == []


@pytest.mark.browser
def test_a_press_on_a_regret_shows_what_else_was_lived_there(
    browser, tmp_path, mission, floor, report
):
    path = write_log(tmp_path / "a.jsonl", mission, floor, report)
    decided = dict(report.frames[0].decision.shares)
    forks = (Fork({**decided, "see": 0.2}, 4.0, report.net + 2), Fork(decided, 2.0, report.net - 1))
    log_regrets(path, tuple(Regret(index, report.net, forks) for index in range(6)))
    page = write_page([read_log(path)], tmp_path / "a.html")
    browser.errors.clear()
    browser.open(page.as_uri())
    assert not browser.run("document.getElementById('regretted').hidden")
    browser.run("document.querySelectorAll('#regret .hit')[3].dispatchEvent(new Event('click'))")
    assert browser.run("location.hash") == "#3"
    assert browser.run("document.querySelectorAll('#forks .hit').length") == 2
    told = browser.run("document.getElementById('here-regretted').textContent")
    assert "2.00 more; 1 of 2 would have been worse" in told
    assert browser.errors == []


@pytest.mark.browser
def test_a_tab_shows_another_policy(browser, logs, tmp_path):
    browser.errors.clear()
    browser.open(write_page(logs, tmp_path / "page.html").as_uri())
    browser.run("document.querySelectorAll('#tabs button')[1].click()")
    assert "min" in browser.run("document.getElementById('mission').textContent")
    assert browser.run("location.hash").startswith("#min:")
    assert browser.errors == []


@pytest.fixture
def live(tmp_path, mission, floor, report):
    """A mission with one frame behind it, its writer, and a server of its page."""
    with LogWriter(tmp_path / "a.jsonl") as writer:
        writer.mission(mission, policy="expected", seed=3, labels=("see", "find_path"), floor=floor)
        writer.frame(report.frames[0])
        with serve(writer.path) as server:
            thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
            thread.start()
            yield server, writer
            server.shutdown()
            thread.join()


def test_a_live_page_is_told_of_each_frame(live, report):
    server, writer = live
    with urllib.request.urlopen(server.url + "events", timeout=20) as events:
        assert int(events.readline()[6:]) == writer.path.stat().st_size
        assert events.readline() == b"\n"
        writer.frame(report.frames[1])
        assert int(events.readline()[6:]) == writer.path.stat().st_size
    with urllib.request.urlopen(server.url + "data", timeout=20) as answer:
        assert len(json.load(answer)["runs"][0]["frames"]) == 2


def test_a_viewer_that_never_reads_holds_nobody(live, report):
    server, writer = live
    with socket.create_connection(server.server_address, timeout=20) as dead:
        dead.sendall(b"GET /events HTTP/1.0\r\nHost: 127.0.0.1:1\r\n\r\n")
        for frame in report.frames[1:]:
            writer.frame(frame)
        with urllib.request.urlopen(server.url + "data", timeout=20) as answer:
            assert len(json.load(answer)["runs"][0]["frames"]) == len(report.frames)


def test_only_this_machine_may_look(live):
    server, _ = live
    assert server.server_address[0] == "127.0.0.1"
    asked = urllib.request.Request(server.url, headers={"Host": "evil.example"})
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(asked, timeout=20)


def test_who_names_no_port_may_look_as_well(live):
    server, _ = live
    asked = urllib.request.Request(server.url, headers={"Host": "127.0.0.1"})
    with urllib.request.urlopen(asked, timeout=20) as answer:
        assert answer.status == 200


def test_a_page_does_not_take_the_place_of_its_log(live, capsys):
    log = live[1].path
    before = log.read_bytes()
    assert main(["replay", str(log), "-o", str(log)]) == 2
    assert "is the log itself" in capsys.readouterr().err
    assert log.read_bytes() == before


def test_what_is_no_log_is_not_served(tmp_path):
    (tmp_path / "a.jsonl").write_text("hello\n")
    with pytest.raises(AnytimeError, match="not JSON"):
        serve(tmp_path / "a.jsonl")


@pytest.mark.browser
def test_a_live_page_moves_on_with_the_mission(browser, live, report):
    server, writer = live
    browser.errors.clear()
    browser.open(server.url)
    where = "document.getElementById('where').textContent"
    assert browser.run(where).startswith("Frame 0, 1 in all")
    writer.frame(report.frames[1])
    browser.wait(f"{where}.startsWith('Frame 1, 2 in all')")
    writer.end(report)
    browser.wait("document.getElementById('mission').textContent.includes('reached after')")
    browser.run("stop()")
    assert browser.errors == []
