"""The report's tables as text: the same rows go into HTML and Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass

from evaluation_report.campaign import Campaign, Run, Status, world_name
from evaluation_report.measures import COMPARED, Score, class_time, scores_of
from evaluation_report.statistics import Interval, Mean, Measure, Ratio, SuccessCount, mean_of, mean_over, paired_ratio, success_count
from evaluation_report.statistics import success_ratio as success_ratio_of
from evaluation_report.thesis_tables import THESIS_TABLES, Mark, ThesisRun, ThesisTable
from evaluation_report.wording import UNKNOWN, clock, number, percent, ranges

THESIS_COLUMNS = (
    "run",
    "runtime [mm:ss]",
    "success",
    "local class.",
    "local class. time [mm:ss]",
    "global class.",
    "global class. time [mm:ss]",
    "class. time [mm:ss]",
)
PRINTED = "thesis as printed"


@dataclass(frozen=True)
class Cell:
    """Text, and a smaller note to it."""

    text: str
    note: str = ""


@dataclass(frozen=True)
class Row:
    """`kind` is run, bad (a run that did not succeed or did not finish) or mean."""

    cells: tuple[Cell, ...]
    kind: str = "run"


@dataclass(frozen=True)
class Table:
    """Rows below columns; the first cell of a row names it."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class SuccessRow:
    """Successes of a world and profile; `left_out` names the runs that are not counted, or says what else is to be known."""

    world: str
    label: str
    count: SuccessCount
    left_out: str = ""

    @property
    def text(self) -> str:
        """Successes of those with a verdict."""
        return f"{self.count.succeeded} of {self.count.judged}" if self.count.judged else UNKNOWN

    @property
    def interval_text(self) -> str:
        """The interval in percent."""
        bounds: Interval | None = self.count.interval
        return f"{100 * bounds.low:.0f}–{100 * bounds.high:.0f} %" if bounds else UNKNOWN


def success_rows(campaign: Campaign) -> tuple[SuccessRow, ...]:
    """World by world: every profile, then the thesis's own result."""
    rows: list[SuccessRow] = []
    for world in campaign.worlds:
        for profile in campaign.profiles:
            runs = campaign.runs_of(world, profile)
            rows.append(SuccessRow(world_name(world), profile, success_count(runs), _uncounted(runs)))
        if (table := THESIS_TABLES.get(world_name(world))) is not None:
            rows.append(_printed_success(table))
    return tuple(rows)


def _uncounted(runs: Sequence[Run]) -> str:
    kinds = (("missing", True), ("not judged", False))
    seeds = [(name, [run.seed for run in runs if run.verdict is None and (run.status is Status.MISSING) is gone]) for name, gone in kinds]
    left_out = [f"{'seeds' if len(numbers) > 1 else 'seed'} {ranges(numbers)} {name}" for name, numbers in seeds if numbers]
    return f"not counted: {', '.join(left_out)}" if left_out else ""


def _printed_success(table: ThesisTable) -> SuccessRow:
    total = len(table.runs)
    also = f"table {table.number}, {table.scenario}; {len(table.acceptable)} more acceptable"
    return SuccessRow(table.world, PRINTED, SuccessCount(len(table.good), total, total), also)


def run_table(profile: str, runs: Sequence[Run]) -> Table:
    """Our runs of one world in the columns of tables 7.1 and 7.2; a run is numbered by its seed."""
    rows = [_run_row(run) for run in runs]
    rows.append(_mean_row("mean of ✓", [run for run in runs if run.verdict], len(runs)))
    rows.append(_mean_row("mean of all", runs, len(runs)))
    return Table(profile, THESIS_COLUMNS, tuple(rows))


def _run_row(run: Run) -> Row:
    if run.status is not Status.FINISHED:
        texts = [str(run.seed), UNKNOWN, run.status.value, *[UNKNOWN] * 5]
        return Row(tuple(Cell(text) for text in texts), "bad")
    local, whole = run.number("local_classifications"), run.number("global_classifications")
    texts = [
        str(run.seed),
        clock(run.number("runtime_s")),
        "?" if run.grade is None else run.grade.value,
        number(local, 0),
        clock(run.number("local_classification_time_s"), 1),
        number(whole, 0),
        clock(run.number("global_classification_time_s"), 1),
        clock(class_time(run), 1),
    ]
    return Row(tuple(Cell(text) for text in texts), "run" if run.verdict else "bad")


def _mean_row(label: str, runs: Sequence[Run], asked: int) -> Row:
    def mean(key: str | Measure) -> Mean:
        measure: Measure = key if callable(key) else lambda run: run.number(key)
        found = mean_of(runs, measure)
        return Mean(found.value, found.runs, asked)

    times = ("runtime_s", "local_classification_time_s", "global_classification_time_s", class_time)
    runtime, local_time, whole_time, total = (mean(key) for key in times)
    local, whole = mean("local_classifications"), mean("global_classifications")
    return Row(
        (
            Cell(label),
            Cell(clock(runtime.value), runtime.covers),
            Cell(""),
            Cell(number(local.value), local.covers),
            Cell(clock(local_time.value, 1), local_time.covers),
            Cell(number(whole.value), whole.covers),
            Cell(clock(whole_time.value, 1), whole_time.covers),
            Cell(clock(total.value, 1), total.covers),
        ),
        "mean",
    )


def printed_table(table: ThesisTable) -> Table:
    """The thesis's figures in the same columns."""
    rows = [_printed_row(run) for run in table.runs]
    rows.append(_printed_mean("mean of ✓", table.good, len(table.runs)))
    rows.append(_printed_mean("mean of all", table.runs, len(table.runs)))
    return Table(f"{PRINTED}, table {table.number}", THESIS_COLUMNS, tuple(rows))


def _printed_row(run: ThesisRun) -> Row:
    local, whole = run.local_classifications, run.global_classifications
    texts = [
        str(run.run),
        clock(run.runtime_s),
        run.mark.value,
        UNKNOWN if local is None else str(local),
        clock(run.local_time_s),
        UNKNOWN if whole is None else str(whole),
        clock(run.global_time_s),
        clock(run.class_time_s),
    ]
    return Row(tuple(Cell(text) for text in texts), "bad" if run.mark is Mark.FAILED else "run")


def _printed_mean(label: str, runs: Sequence[ThesisRun], asked: int) -> Row:
    runtime = mean_over((run.runtime_s for run in runs), asked)
    local, whole = (
        mean_over((run.local_classifications for run in runs), asked),
        mean_over((run.global_classifications for run in runs), asked),
    )
    times = [mean_over(values, asked) for values in zip(*((r.local_time_s, r.global_time_s, r.class_time_s) for r in runs), strict=True)]
    return Row(
        (
            Cell(label),
            Cell(clock(runtime.value), runtime.covers),
            Cell(""),
            Cell(number(local.value), local.covers),
            Cell(clock(times[0].value), times[0].covers),
            Cell(number(whole.value), whole.covers),
            Cell(clock(times[1].value), times[1].covers),
            Cell(clock(times[2].value), times[2].covers),
        ),
        "mean",
    )


def score_table(profile: str, runs: Sequence[Run]) -> Table:
    """All scores of the runs of one world and profile."""
    scores = scores_of(runs)
    columns = ("seed", *(f"{s.heading} [{s.unit}]" if s.unit else s.heading for s in scores))
    return Table(profile, columns, (*(_score_row(run, scores) for run in runs), _score_means(runs, scores)))


def _score_row(run: Run, scores: Sequence[Score]) -> Row:
    if run.status is not Status.FINISHED:
        return Row((Cell(str(run.seed), run.status.value), *(Cell(UNKNOWN) for _ in scores)), "bad")
    cells = (Cell(number(s.of(run), s.digits, s.factor)) for s in scores)
    return Row((Cell(str(run.seed)), *cells), "run" if run.verdict else "bad")


def _score_means(runs: Sequence[Run], scores: Sequence[Score]) -> Row:
    cells = []
    for s in scores:
        found = mean_of(runs, s.of, s.combine)
        kind = "" if s.combined == "mean" else f"{s.combined}, "
        cells.append(Cell(number(found.value, s.digits, s.factor), kind + found.covers))
    return Row((Cell("mean"), *cells), "mean")


def ratio_table(campaign: Campaign, world: str) -> Table | None:
    """The reference profile over each other one, and over the thesis as printed; None when there is nothing to compare with."""
    others = [profile for profile in campaign.profiles if profile != campaign.reference]
    printed = THESIS_TABLES.get(world_name(world))
    if not others and printed is None:
        return None
    ours = campaign.runs_of(world, campaign.reference)
    baselines = [campaign.runs_of(world, profile) for profile in others]
    rows = [Row((Cell("success", "more is better"), *(_ratio_cell(success_ratio_of(ours, runs)) for runs in baselines)))]
    for compared in COMPARED:
        cells = (_ratio_cell(paired_ratio(ours, runs, compared.measure)) for runs in baselines)
        rows.append(Row((Cell(compared.heading, compared.better), *cells)))
    columns = [f"{campaign.reference} / {profile}" for profile in others]
    if printed is not None:
        columns.append(f"{campaign.reference} / {PRINTED}")
        rows = [Row((*row.cells, cell)) for row, cell in zip(rows, _printed_ratios(ours, printed), strict=True)]
    return Table(world_name(world), ("", *columns), tuple(rows))


def _ratio_cell(ratio: Ratio) -> Cell:
    seeds = f"{ratio.pairs} {'seed' if ratio.pairs == 1 else 'seeds'}"
    if ratio.value is None:
        return Cell(UNKNOWN, f"the other has 0, {seeds}" if ratio.pairs else "no seed of both")
    span = f"{ratio.low:.2f}–{ratio.high:.2f}, " if ratio.low is not None and ratio.high is not None else ""
    return Cell(f"{ratio.value:.2f}", span + seeds)


def _printed_ratios(ours: Sequence[Run], printed: ThesisTable) -> list[Cell]:
    """In the order of the rows: success, then COMPARED; means of the successful runs of both, seeds mean nothing to the thesis."""
    count = success_count(ours)
    share = len(printed.good) / len(printed.runs)
    success = Cell(UNKNOWN if count.share is None else f"{count.share / share:.2f}", f"{percent(count.share)} and {percent(share)}")
    good = [run for run in ours if run.verdict]
    theirs = {
        "runtime_s": mean_over((run.runtime_s for run in printed.good), len(printed.runs)),
        "class_time_s": mean_over((run.class_time_s for run in printed.good), len(printed.runs)),
    }
    return [success, *(_printed_ratio(mean_of(good, c.measure), theirs.get(c.key), len(ours)) for c in COMPARED)]


def _printed_ratio(ours: Mean, theirs: Mean | None, asked: int) -> Cell:
    if theirs is None:
        return Cell(UNKNOWN, "not in the thesis")
    if ours.value is None or not theirs.value:
        return Cell(UNKNOWN, "no successful run to compare")
    digits = 2 if ours.value >= 0.1 * theirs.value else 3
    return Cell(f"{ours.value / theirs.value:.{digits}f}", f"means of ✓: {ours.runs}/{asked} and {theirs.covers}")
