"""The command line of ./explore: checks what was asked, starts the launch file with a ROS master of its own, tells how it ended."""
