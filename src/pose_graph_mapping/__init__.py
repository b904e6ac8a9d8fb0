"""3-D mapping (thesis 5.4, 6.1): registration of sweeps, pose graph, loop closure, and what a session leaves on disk.

Registration stands behind the service `match_clouds`; the mapper turns sweeps and odometry into vertices and T_map_odom.
"""
