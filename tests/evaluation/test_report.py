from __future__ import annotations

import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from tests.evaluation.fake_task import FAMILIES
from tests.evaluation.test_records import BOX
from tests.evaluation.test_summary import LOST
from tr_grasp.configs import CameraCfg, EnvCfg, NetworkCfg, TrainCfg
from tr_grasp.evaluation.film import encode_gif
from tr_grasp.evaluation.page import table
from tr_grasp.evaluation.plots import DARK, LIGHT, plots_of
from tr_grasp.evaluation.report import Evaluation, Shown, describe_objects, differing_settings, report_html
from tr_grasp.evaluation.suites import named_suites
from tr_grasp.evaluation.summary import by_family, by_number
from tr_grasp.provenance import Provenance

SOURCE = Provenance(
    command="tr-grasp evaluate 'my <policy>'",
    commit="0123abc-dirty",
    started="2025-01-01T00:00:00+00:00",
    machine="A fast one, 2 cores",
    versions={"torch": "2.9"},
)
SUITES = named_suites("all", EnvCfg(control_hz=2.5), objects="test", episodes=2, first_seed=20_000)
RECORDS = [
    replace(record, suite=suite.name, families=(family,))
    for suite, family in zip(SUITES, FAMILIES, strict=True)
    for record in (BOX, LOST)
]
TRAINING = TrainCfg(seed=7, network=NetworkCfg(encoder="vanilla_ocnn"))
EVALUATION = Evaluation("my <policy>", SUITES, RECORDS, SOURCE, TRAINING)
GIF = encode_gif([np.zeros((8, 8, 3), np.uint8)], 0.1)


class Balance(HTMLParser):
    """Every tag that is opened is closed, in order."""

    VOID = frozenset({"meta", "img", "source"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


@pytest.fixture(scope="module")
def html() -> str:
    return report_html(EVALUATION, [Shown(BOX, BOX, GIF), Shown(LOST, replace(LOST, steps=99), GIF)])


def test_the_report_is_one_whole_page(html: str) -> None:
    page = Balance(html)
    assert page.open == []
    assert "6 episodes" in html
    text = " ".join(page.words)
    for word in (
        "3 of 6 episodes lifted an object: 50.0 %",
        "single",
        "scattered",
        "pile",
        "slipped",
        *SOURCE.versions,
    ):
        assert word in text
    assert "tr-grasp evaluate 'my <policy>'" in text


def test_the_report_needs_nothing_beside_it(html: str) -> None:
    sources = re.findall(r'(?:src|srcset|href)="([^"]{0,30})', html)
    assert sources
    assert all(source.startswith("data:image/") for source in sources)
    assert "http" not in html
    assert "<script" not in html


def test_names_cannot_break_the_page(html: str) -> None:
    assert "my <policy>" not in html
    assert "my &lt;policy&gt;" in html
    assert table(["a"], [["<b> & c"]]).count("<b>") == 1, "cells that begin with a tag are HTML"
    assert "x &lt;b&gt;" in table(["a"], [["x <b>"]])


def test_a_film_that_ended_otherwise_says_so(html: str) -> None:
    assert html.count("the judged episode ended otherwise") == 1
    assert "slipped after 100 steps" in html


def test_settings_that_differ_are_listed(html: str) -> None:
    text = " ".join(Balance(html).words)
    for word in (
        "env.control_hz",
        "2.5   (default: 4.0)",
        "network.encoder",
        "vanilla_ocnn",
        "env.objects.count_range (pile)",
    ):
        assert word in text
    assert "env.physics_hz" not in text


def test_differing_settings_by_hand() -> None:
    mine = EnvCfg(camera=CameraCfg(image_size_px=64))
    assert differing_settings(mine, EnvCfg()) == [("camera.image_size_px", "64   (default: 80)")]
    assert differing_settings(mine, mine) == []


def test_an_evaluation_that_was_cut_short_says_so() -> None:
    short = report_html(Evaluation("zero", SUITES, RECORDS[:2], SOURCE))
    assert "Stopped early: 6 episodes were asked for." in short
    assert "Replays" not in short


def test_the_summary_for_programs_by_hand() -> None:
    summary = EVALUATION.as_json()
    assert (summary["policy"], summary["episodes_asked"], summary["episodes_finished"]) == ("my <policy>", 6, 6)
    assert [suite["success_rate"] for suite in summary["suites"]] == [0.5] * 3
    assert summary["by_family"]["mug"] == [1, 2]
    assert summary["commit"] == "0123abc-dirty"


def test_objects_in_words() -> None:
    env = SUITES[0].env
    assert describe_objects(env) == "held-out procedural objects"
    folder = replace(env, objects=replace(env.objects, source="/data/household/test"))
    assert describe_objects(folder) == "objects of household/test"


@pytest.mark.parametrize("records", [RECORDS, [BOX], [LOST]], ids=["mixed", "success", "failure"])
@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_every_plot_can_be_drawn(records: list, theme: object) -> None:
    for plot in plots_of(records, by_family(records), by_number(records)):
        picture = np.asarray(Image.open(io.BytesIO(plot.png(theme, dots_per_inch=40))).convert("RGBA"))
        assert picture[0, 0, 3] == 0, "the ground is the page's"
        assert (picture[..., 3] > 100).any()
