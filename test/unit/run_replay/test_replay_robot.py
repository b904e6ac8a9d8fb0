"""Which joints of the robot a replay has to hold at rest."""

from pathlib import Path

from ros_adapters.replay_topics import moving_joints

URDF = Path(__file__).resolve().parents[3] / "urdf" / "husky.urdf"


def test_wheels_and_laser_move_and_what_is_bolted_does_not() -> None:
    joints = moving_joints(URDF.read_text())
    assert joints["tilt_joint"] == "tilt_link" and "front_left_wheel" in joints
    assert not {"mast_joint", "laser_joint", "imu_joint"} & set(joints)


def test_no_robot_has_no_joints() -> None:
    assert moving_joints("") == {}
