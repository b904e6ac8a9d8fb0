"""Tables 7.1 and 7.2 of Stradner's thesis (2017): ten runs indoors and ten outdoors, in its simulator.

They are typed from a scan. The runs' own numbers follow from their order, and marks that the scan lost follow from the text of 7.2 and
7.3 (indoors 5, 7 and 8 failed and 9 was acceptable; outdoors 9 failed, 3, 6, 7 and 8 were acceptable). A count
of which the scan leaves no digit, or one of those that it confuses when they stand alone (6, 7 and 9), is unknown. Of run 5
indoors the thesis itself has no classifications. Times were checked: local and global add up to the last column, to a second.
"""

import enum
from dataclasses import dataclass


class Mark(enum.Enum):
    """The thesis's judgement of a run, by eye."""

    GOOD = "✓"
    ACCEPTABLE = "~"
    FAILED = "×"


@dataclass(frozen=True)
class ThesisRun:
    """A row as printed; seconds, None where it is not known."""

    run: int
    runtime_s: float
    mark: Mark
    local_classifications: int | None
    local_time_s: float | None
    global_classifications: int | None
    global_time_s: float | None
    class_time_s: float | None


@dataclass(frozen=True)
class ThesisTable:
    """A table, and the world of ours that is built after its scenario."""

    number: str
    scenario: str
    world: str
    runs: tuple[ThesisRun, ...]

    @property
    def good(self) -> tuple[ThesisRun, ...]:
        """The runs that the thesis counts as successful."""
        return tuple(run for run in self.runs if run.mark is Mark.GOOD)

    @property
    def acceptable(self) -> tuple[ThesisRun, ...]:
        """The runs with a result that could have been better."""
        return tuple(run for run in self.runs if run.mark is Mark.ACCEPTABLE)


# run, runtime, success, local class., local class. time, global class., global class. time, class. time; "-" is unknown
_TABLE_7_1 = """
 1  11:27  ✓  14  01:17  -  01:29  02:46
 2  11:03  ✓  16  01:17  3  01:21  02:38
 3  11:14  ✓  19  01:36  3  01:10  02:46
 4  12:24  ✓  17  01:40  4  01:45  03:25
 5  01:15  ×   -      -  -      -      -
 6  10:02  ✓  18  01:14  -  00:54  02:08
 7  08:08  ×  13  01:07  -  00:11  01:18
 8  15:57  ×  18  01:52  5  02:23  04:15
 9  18:21  ~  18  02:45  -  04:30  07:15
10  11:41  ✓  16  01:37  4  02:07  03:44
"""
_TABLE_7_2 = """
 1  08:43  ✓  13  00:34  2  00:13  00:47
 2  07:22  ✓  11  00:24  3  00:23  00:48
 3  07:39  ~   8  00:12  2  00:11  00:23
 4  06:23  ✓  11  00:20  2  00:14  00:34
 5  05:31  ✓  10  00:20  -  00:08  00:28
 6  06:47  ~  15  00:28  2  00:10  00:38
 7  05:34  ~  14  00:32  2  00:19  00:51
 8  07:20  ~   -  00:23  2  00:24  00:47
 9  05:31  ×   -  00:10  1  00:03  00:13
10  05:25  ✓  12  00:26  -  00:29  00:55
"""


def _seconds(text: str) -> float | None:
    if text == "-":
        return None
    minutes, seconds = text.split(":")
    return 60.0 * int(minutes) + int(seconds)


def _count(text: str) -> int | None:
    return None if text == "-" else int(text)


def _row(line: str) -> ThesisRun:
    run, runtime, mark, local, local_time, whole, whole_time, total = line.split()
    return ThesisRun(
        int(run),
        _seconds(runtime) or 0.0,
        Mark(mark),
        _count(local),
        _seconds(local_time),
        _count(whole),
        _seconds(whole_time),
        _seconds(total),
    )


def _table(number: str, scenario: str, world: str, text: str) -> ThesisTable:
    return ThesisTable(number, scenario, world, tuple(_row(line) for line in text.strip().splitlines()))


THESIS_TABLES: dict[str, ThesisTable] = {
    "ramp": _table("7.1", "indoor", "ramp", _TABLE_7_1),
    "moon": _table("7.2", "outdoor", "moon", _TABLE_7_2),
}
"""By the name of our world."""
