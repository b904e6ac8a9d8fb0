#!/usr/bin/env python3
"""Kills the terrain node in a run and looks for the promised end: the system test of the same name, as a rostest."""

import sys
import unittest
from pathlib import Path

import pytest

import rostest

SYSTEM_TEST = Path(__file__).resolve().parents[1] / "system" / "test_node_death.py"


class NodeDeathTest(unittest.TestCase):
    def test_killed_terrain_node_ends_the_run_as_promised(self) -> None:
        self.assertEqual(pytest.main(["-q", "-p", "no:cacheprovider", str(SYSTEM_TEST)]), 0)


if __name__ == "__main__":
    rostest.rosrun("explore_3dnav", "node_death", NodeDeathTest, sys.argv)
