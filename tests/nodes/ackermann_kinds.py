"""The messages of ackermann_msgs, generated from their definition."""

from genpy.dynamic import generate_dynamic

DRIVE = """float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
"""
HEADER = """uint32 seq
time stamp
string frame_id
"""
BREAK = "=" * 80 + "\nMSG: "
kinds = generate_dynamic(
    "ackermann_msgs/AckermannDriveStamped",
    f"Header header\nAckermannDrive drive\n{BREAK}std_msgs/Header\n{HEADER}"
    f"{BREAK}ackermann_msgs/AckermannDrive\n{DRIVE}",
)
AckermannDrive = kinds["ackermann_msgs/AckermannDrive"]
AckermannDriveStamped = kinds["ackermann_msgs/AckermannDriveStamped"]
for kind in (AckermannDrive, AckermannDriveStamped):
    kind.__name__ = kind._type.rpartition("/")[2]  # as those of a package are called
