"""A deadline that becomes known on the way: what it is worth to decide by it from then on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments import shipped
from experiments.comparing import bootstrap
from monitor.missions import News, Value
from monitor.policies import Informed
from monitor.robots.briefing import brief
from monitor.robots.grid_missions import read_mission

NEWS = News(20.0, Value("hard", 100.0, 75.0))  # the office has 85 s, and then falls slowly


def news_figures(seed: int, missions: int) -> dict[str, float | int | None]:
    """Figures under `news.`: mean net value of `expected` that decides by the news, and of the
    same that goes on as if there were none; the difference, paired, with interval."""
    grid = read_mission(shipped.mission_path())
    grid = replace(grid, mission=replace(grid.mission, news=NEWS))
    briefing = brief(grid, shipped.profiles())
    told = briefing.monitor("expected")
    assert isinstance(told.policy, Informed)
    deaf = replace(told, policy=told.policy.before)
    seeds = range(seed * missions, seed * missions + missions)
    nets = [np.array([briefing.live(m, each).net for each in seeds]) for m in (told, deaf)]
    margin = bootstrap(nets, lambda informed, without: informed - without)
    return {
        "news.value": float(nets[0].mean()),
        "news.value_deaf": float(nets[1].mean()),
        **margin.under("news.margin"),
    }
