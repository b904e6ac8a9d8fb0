"""./replay: finished runs, recorded bags and comparisons of two runs, made ready for rviz; what is shown at which time, without ROS.

`arguments` and `launching` are the command; `recorded_run`, `comparison`, `timeline`, `growing_cloud` and `bag_topics` are what
`run_replay_node` shows. `export` and `mcap_messages` write the same into a file.
"""
