"""Terrain without ROS: a map from a file is classified, its frontiers found and a path planned, by the same functions as in the node."""
