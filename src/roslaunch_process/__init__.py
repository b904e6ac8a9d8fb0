"""roslaunch as a child of a command: a master's port, one life with its parent, Ctrl-C handed on, and the lines that are for the terminal.

Below the programs ./explore, ./replay and ./evaluate.
"""

from roslaunch_process.children import descendants, end_with_parent, send
from roslaunch_process.launch import free_port, hand_on_signals, shown_lines, start_launch

__all__ = ["descendants", "end_with_parent", "free_port", "hand_on_signals", "send", "shown_lines", "start_launch"]
