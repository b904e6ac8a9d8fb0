"""Mapping without ROS: a recorded bag or a folder of sweeps becomes a map, and what a map is made of can be worked on by itself."""
