"""The message types that a recording made without ROS may hold, as rosbag2 stores them.

Comments are left out of the definitions: the hash of a type (RIHS01) does not cover them.
"""

from emir_msgs_py.topics import FLUID_PRESSURE, JOINT_STATE

FLOAT64 = "std_msgs/msg/Float64"

_SEPARATOR = "=" * 80
_HEADER = f"""{_SEPARATOR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

DEFINITIONS = {
    JOINT_STATE: f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_HEADER}""",
    FLUID_PRESSURE: f"""std_msgs/Header header
float64 fluid_pressure
float64 variance
{_HEADER}""",
    FLOAT64: "float64 data\n",
}

HASHES = {
    JOINT_STATE: "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    FLUID_PRESSURE: "RIHS01_22dfb2b145a0bd5a31a1ac3882a1b32148b51d9b2f3bab250290d66f3595bc32",
    FLOAT64: "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
}
