"""When the simulated sensors measure, and when and how often their messages come."""

from dataclasses import dataclass

from pybullet_simulation.sensor_faults import SensorFault, read_fault
from stage_config import check_ranges, parameter

SENSOR_TOPICS = ("/scan", "/points", "/joint_states", "/imu/data", "/wheel_odom")
"""The sensors by the topic that they are heard on; /points stands for /scan with a spinning lidar."""


@dataclass(frozen=True)
class TimingConfig:
    """The sensors' clocks and lines; each latency counts from the stamp, which is the time of the measurement."""

    phase_share: float = parameter(
        1.0, "-", "a sensor starts so late at most, as a share of its period, drawn once: drivers start when they are up", low=0.0, high=1.0
    )
    jitter_share: float = parameter(
        0.015, "-", "sigma of a period as a share of it, three at most; a UTM-30LX's motor keeps its speed to 1 %", low=0.0, high=0.05
    )
    scan_latency_s: float = parameter(
        0.025, "s", "from a scan's first beam to its message; a turn of a UTM-30LX takes as long", low=0.019, high=1.0
    )
    points_latency_s: float = parameter(
        0.11, "s", "from the first beam of a spinning lidar's revolution to its message; a turn takes 0.1", low=0.1, high=1.0
    )
    imu_latency_s: float = parameter(
        0.003, "s", "from a sample of the IMU to its message: a serial line of 115,200 baud", low=0.0, high=1.0
    )
    joint_latency_s: float = parameter(0.012, "s", "from joint angles to their message: the base answers in 10 to 15 ms", low=0.0, high=1.0)
    wheel_latency_s: float = parameter(0.012, "s", "from wheel odometry to its message, by the same line", low=0.0, high=1.0)
    lost_share: float = parameter(0.002, "-", "share of the messages that are lost, as on a busy USB or UDP line", low=0.0, high=0.5)
    doubled_share: float = parameter(0.001, "-", "share of the messages that come twice, with the same stamp", low=0.0, high=0.5)
    faults: str = parameter(
        "",
        "-",
        "for tests: KIND TOPIC FROM TO, in seconds since the simulator's start, more after commas: silent /scan 20 25, nan /imu/data 40 41;"
        " late: stamps are 3 s too old",
    )

    def validate(self) -> list[str]:
        """All violations, as sentences; empty when the configuration can be used."""
        problems = check_ranges(self)
        try:
            self.sensor_faults()
        except ValueError as error:
            problems.append(str(error))
        return problems

    def sensor_faults(self) -> tuple[SensorFault, ...]:
        """What `faults` says. ValueError names the part that cannot be read."""
        return tuple(read_fault(part, SENSOR_TOPICS) for part in self.faults.split(",") if part.strip())
