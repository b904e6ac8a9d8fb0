"""The written report: whole in every state of a campaign, readable offline, and the same for the same folder."""

import json
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import pytest
from campaign_on_disk import SUMMARY, write_campaign, write_run
from PIL import Image

from evaluation_report import load_campaign, write_report
from evaluation_report.charts import activity_chart, coverage_chart, embedded, standalone
from evaluation_report.gallery import worst_first
from evaluation_report.pictures import small_picture
from evaluation_report.report import markdown_text
from evaluation_report.tables import ratio_table, run_table, score_table, success_rows
from evaluation_report.wording import UNKNOWN

VOID = {"meta", "link", "img", "br", "hr", "input", "rect", "use", "path"}


class Page(HTMLParser):
    """Collects ids, addresses and text, and checks that tags close in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.ids += [given["id"]] if "id" in given else []
        self.addresses += [given[key] for key in ("src", "href", "xlink:href") if key in given]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def picture(folder, name="map_top.png", colour="white", size=(1500, 1150)):
    Image.effect_noise(size, 60).convert("RGB").save(folder / name) if colour == "noise" else Image.new("RGB", size, colour).save(
        folder / name
    )


@pytest.fixture
def folder(tmp_path):
    """Two profiles on ramp and rooms with all that can happen: finished, failed, crashed, hung, missing, nulls."""
    folder = write_campaign(tmp_path / "campaign", worlds=("ramp", "rooms"), seeds=(1, 2, 3), profiles=("ours", "thesis"))
    picture(write_run(folder, "ramp", 1))
    write_run(folder, "ramp", 2, success=False, stop_reason="trapped: <b>&", coverage_curve=None, activity_s=None)
    write_run(folder, "ramp", 1, "thesis", config={"octomap_server_3dnav_node": {"resolution": 0.16, "out": "elsewhere"}})
    write_run(folder, "ramp", 2, "thesis", status="crashed", error="exit code 1 | of a <node>")
    write_run(folder, "rooms", 1, **dict.fromkeys(set(SUMMARY) - {"config"}))
    return folder


def test_report_is_one_page_that_asks_for_nothing_outside(folder):
    page, markdown = write_report(folder)
    assert (page, markdown) == (folder / "report.html", folder / "report.md")
    read = Page(page.read_text())
    assert read.open == []
    assert all(address.startswith(("#", "data:")) for address in read.addresses)
    assert len(read.ids) == len(set(read.ids))
    assert {address[1:] for address in read.addresses if address.startswith("#")} <= set(read.ids)
    assert "@import" not in page.read_text() and "url(http" not in page.read_text()


def test_runs_without_a_result_are_named(folder):
    page, markdown = write_report(folder)
    text = Page(page.read_text()).text
    for told in ("ours, ramp 3 – missing: not made", "thesis, ramp 2 – crashed: exit code 1 | of a <node>", "trapped: <b>&"):
        assert told in text
    assert "thesis, ramp 2 – crashed: exit code 1 \\| of a \\<node>" in markdown.read_text()
    assert "./replay" in text


def test_means_say_how_many_runs_they_cover(folder):
    runs = load_campaign(folder).runs_of("ramp", "ours")
    rows = run_table("ours", runs).rows
    assert [row.kind for row in rows] == ["run", "bad", "bad", "mean", "mean"]
    assert [row.cells[1].note for row in rows[3:]] == ["1/3", "2/3"]
    assert rows[2].cells[2].text == "missing"
    assert score_table("ours", runs).rows[-1].cells[1].note == "2/3"


def test_scores_say_where_the_time_went_and_what_the_clairvoyant_would_have_taken(tmp_path):
    campaign = write_campaign(tmp_path, seeds=(1, 2))
    write_run(campaign, "ramp", 1, clairvoyant_ratio=2.125)
    write_run(campaign, "ramp", 2)
    table = score_table("ours", load_campaign(campaign).runs_of("ramp", "ours"))
    shown = {heading: [row.cells[k].text for row in table.rows] for k, heading in enumerate(table.columns)}
    assert shown["time / clairvoyant's"] == ["2.12", UNKNOWN, "2.12"]
    assert shown["turning on the spot [s]"] == ["20"] * 3
    assert shown["standing to sweep [s]"] == ["160"] * 3


def test_thesis_s_own_result_stands_beside_ours_where_there_is_one(folder):
    rows = success_rows(load_campaign(folder))
    assert [(row.world, row.label) for row in rows] == [
        ("ramp", "ours"),
        ("ramp", "thesis"),
        ("ramp", "thesis as printed"),
        ("rooms", "ours"),
        ("rooms", "thesis"),
    ]
    assert (rows[2].text, rows[2].interval_text) == ("6 of 10", "31–83 %")
    assert (rows[0].text, rows[0].left_out) == ("1 of 2", "not counted: seed 3 missing")
    assert (rows[4].text, rows[4].interval_text) == ("–", "–")


def test_ratios_give_no_number_where_there_is_none(folder):
    campaign = load_campaign(folder)
    table = ratio_table(campaign, "ramp")
    cells = {row.cells[0].text: [(cell.text, cell.note) for cell in row.cells[1:]] for row in table.rows}
    assert cells["coverage"] == [("1.00", "1.00–1.00, 1 seed"), ("–", "not in the thesis")]
    assert cells["runtime"][1] == ("0.62", "means of ✓: 1/3 and 6/10")
    assert cells["success"] == [("1.00", "2 seeds"), ("0.83", "50 % and 60 %")]
    rooms = ratio_table(campaign, "rooms")
    assert {cell.text for row in rooms.rows for cell in row.cells[1:]} == {"–"}


def test_one_profile_in_a_world_of_ours_has_no_ratios(tmp_path):
    assert ratio_table(load_campaign(write_campaign(tmp_path, worlds=("rooms",))), "rooms") is None


def test_campaign_without_a_single_run_is_reported(tmp_path):
    page, markdown = write_report(write_campaign(tmp_path))
    assert "4 missing" in Page(page.read_text()).text
    assert "no run was judged" in markdown.read_text()
    assert not list((tmp_path / "figures").iterdir())


def test_results_file_has_every_run_and_null_for_unknown(folder):
    write_report(folder)
    found = json.loads((folder / "results.json").read_text())
    assert len(found["runs"]) == 12
    by_name = {(run["profile"], run["world"], run["seed"]): run for run in found["runs"]}
    assert by_name["ours", "ramp", 1]["class_time_s"] == 1.5
    assert by_name["ours", "ramp", 1]["missed_m2"] == pytest.approx(20.0)
    assert by_name["ours", "rooms", 1]["coverage"] is None
    assert by_name["thesis", "ramp", 3]["status"] == "missing"
    group = next(g for g in found["groups"] if (g["world"], g["profile"]) == ("ramp", "thesis"))
    assert group["combined"]["coverage"] == {"mean": 0.9, "runs": 1, "asked": 3}
    assert group["ratios"]["runtime_s"]["pairs"] == 1


def test_same_folder_gives_the_same_report(folder):
    first = [path.read_bytes() for path in write_report(folder)]
    figures = {path.name: path.read_bytes() for path in (folder / "figures").iterdir()}
    assert [path.read_bytes() for path in write_report(folder)] == first
    assert {path.name: path.read_bytes() for path in (folder / "figures").iterdir()} == figures
    assert not [path.name for path in folder.iterdir() if path.name.startswith(".")]


def test_profiles_are_compared_by_their_parameters_without_those_of_the_run(folder):
    text = Page(write_report(folder)[0].read_text()).text
    assert "octomap_server_3dnav_node/resolution" in text
    assert "elsewhere" not in text


def test_markdown_links_figures_that_are_there(folder):
    text = write_report(folder)[1].read_text()
    links = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
    assert links == ["figures/coverage_ramp.svg", "figures/activity_ramp.svg"]
    for link in links:
        ET.fromstring((folder / link).read_text())


def test_markdown_tables_have_as_many_cells_as_columns(folder):
    lines = write_report(folder)[1].read_text().splitlines()
    counts = [len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0 for line in lines]
    assert all(a == b for a, b in zip(counts, counts[1:], strict=False) if a and b)
    assert markdown_text("a | b *c*\nd") == "a \\| b \\*c\\* d"


def test_charts_are_drawings_of_all_runs_in_one_colour_a_profile(folder):
    campaign = load_campaign(folder)
    for svg in (coverage_chart(campaign, "ramp"), coverage_chart(campaign, "ramp", over_distance=True), activity_chart(campaign, "ramp")):
        root = ET.fromstring(svg)
        assert root.tag.endswith("svg")
        ET.fromstring(standalone(svg).encode())
        shown = embedded(svg, "p1", "a title")
        assert 'aria-label="a title"' in shown and 'width="' not in shown[: shown.index(">")]
        assert "var(--ink)" in shown
    assert "coverage [%]" in coverage_chart(campaign, "ramp")
    assert coverage_chart(campaign, "rooms") is None and activity_chart(campaign, "rooms") is None


def test_picture_of_what_was_missed_is_preferred_and_small(tmp_path):
    picture(tmp_path, colour="noise")
    small = small_picture(tmp_path, 760, 60_000)
    assert small is not None and len(small) <= 60_000
    picture(tmp_path, "map_missed.png", "red", (400, 300))
    assert small_picture(tmp_path, 760, 60_000) != small
    (tmp_path / "map_missed.png").write_bytes(b"\x89PNG cut off")
    assert small_picture(tmp_path, 760, 60_000) == small


def test_run_without_picture_is_shown_all_the_same(folder, tmp_path):
    assert small_picture(tmp_path, 760, 60_000) is None
    page = write_report(folder)[0].read_text()
    assert page.count("no picture") == 11 and page.count("data:image/webp") == 1


def test_order_of_runs_does_not_depend_on_the_disk(folder):
    runs = load_campaign(folder).runs
    assert worst_first(runs) == worst_first(tuple(runs))
    assert worst_first(runs)[-1].verdict is True
