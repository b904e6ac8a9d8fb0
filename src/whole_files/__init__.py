"""Files that are whole or not there, lines that wait for the disk, and what a person is told of a disk that takes nothing."""

from whole_files.lines import WaitingLines
from whole_files.outputs import check_files, check_folder, check_not_read, is_same, lies_in
from whole_files.refusals import RefusedError, refusal
from whole_files.streams import words_end_nobody
from whole_files.whole import remove_unfinished, sync_folder, write_all, write_whole, written_whole

__all__ = [
    "RefusedError",
    "WaitingLines",
    "check_files",
    "check_folder",
    "check_not_read",
    "is_same",
    "lies_in",
    "refusal",
    "remove_unfinished",
    "sync_folder",
    "words_end_nobody",
    "write_all",
    "write_whole",
    "written_whole",
]
