"""sensor_msgs/PointCloud2 as drivers write it, read into arrays: of rospy's messages and of rosbags'. Stands before all who take clouds.

`read_points` is for finished clouds, `read_beams` for those of a lidar that moves; `driver_fields` says what is read from which field.
"""

from point_cloud2.driver_fields import field_table
from point_cloud2.reading import BeamCloud, PointTable, read_beams, read_points

__all__ = [
    "BeamCloud",
    "PointTable",
    "field_table",
    "read_beams",
    "read_points",
]
