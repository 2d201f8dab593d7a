"""Writes the files of this folder with the libraries that people use: scipy, pyarrow, rosbags, mcap-ros2-support.

python3 make.py    in this folder, with ../davinci-jaw/00.csv beside it
"""

import csv
import pathlib
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

FOLDER = pathlib.Path(__file__).parent
EPOCH_NS = 1_763_809_215_000_000_000

rows = list(csv.DictReader(open(FOLDER / "../davinci-jaw/00.csv")))[::4]
time_s = np.array([float(r["time_s"]) for r in rows])
u_deg = np.array([float(r["u1_deg"]) for r in rows])
y_deg = np.array([float(r["y1_deg"]) for r in rows])
torque_nm = np.array([float(r["drive_torque_nm"]) for r in rows])
y_gaps_deg = y_deg.copy()
y_gaps_deg[10:20] = np.nan
table = {"time_s": time_s, "u1_deg": u_deg, "y1_deg": y_gaps_deg, "drive_torque_nm": torque_nm}
stamps_ns = EPOCH_NS + np.round(time_s * 1e9).astype(np.int64)

with open(FOLDER / "jaw.csv", "w") as file:
    file.write(",".join(table) + "\n")
    for row in zip(*table.values()):
        file.write(",".join("" if np.isnan(v) else repr(float(v)) for v in row) + "\n")

# A table as pyarrow writes it, and one as data bases do: row groups, other types, times since 1970, labels, zstd.
nulls = [None if np.isnan(v) else v for v in y_gaps_deg]
columns = {name: pa.array(nulls if name == "y1_deg" else values) for name, values in table.items()}
pq.write_table(pa.table(columns), FOLDER / "jaw.parquet")
other = pa.table(
    {
        "stamp": pa.array(stamps_ns, pa.timestamp("ns")),
        "motor_mdeg": pa.array(np.round(u_deg * 1000).astype(np.int32)),
        "jaw_deg": pa.array(nulls, pa.float32()),
        "run": pa.array(["up" if k < 125 else "down" for k in range(len(rows))]).dictionary_encode(),
        "samples": pa.array([[1.0, 2.0]] * len(rows)),
    }
)
pq.write_table(other, FOLDER / "other.parquet", compression="zstd", row_group_size=100, data_page_version="2.0")
pq.write_table(other.select(["motor_mdeg"]), FOLDER / "brotli.parquet", compression="brotli")

scipy.io.savemat(FOLDER / "jaw.mat", table, do_compression=True)
# As a struct and as a matrix beside it, uncompressed, with what is no column.
scipy.io.savemat(
    FOLDER / "struct.mat",
    {"run": {"stamp_ns": stamps_ns, "q_deg": np.stack([u_deg, y_gaps_deg], 1).astype(np.float32), "rate": 12.5, "by": "hand"}},
)
scipy.io.savemat(FOLDER / "level4.mat", {"t": time_s[:4]}, format="4")

# A bag as `ros2 bag record` leaves it: drive and jaw with stamps in their headers.
store = get_typestore(Stores.ROS2_HUMBLE)
JointState = store.types["sensor_msgs/msg/JointState"]
Header = store.types["std_msgs/msg/Header"]
Time = store.types["builtin_interfaces/msg/Time"]


def joint_state(stamp_ns, position_rad, effort_nm):
    header = Header(Time(int(stamp_ns // 10**9), int(stamp_ns % 10**9)), "")
    effort = np.array([effort_nm] if effort_nm is not None else [])
    return JointState(header, ["jaw"], np.array([position_rad]), np.array([]), effort)


shutil.rmtree(FOLDER / "bag", ignore_errors=True)
bag = Writer(FOLDER / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
with bag as writer:
    kind = JointState.__msgtype__
    commanded = writer.add_connection("/drive/setpoint", kind, typestore=store)
    measured = writer.add_connection("/jaw/measured", kind, typestore=store)
    for stamp, u, y, torque in zip(stamps_ns, np.deg2rad(u_deg), np.deg2rad(y_gaps_deg), torque_nm):
        writer.write(commanded, int(stamp) + 2_000_000, store.serialize_cdr(joint_state(stamp, u, torque), kind))
        if not np.isnan(y):
            writer.write(measured, int(stamp) + 3_000_000, store.serialize_cdr(joint_state(stamp, y, None), kind))
shutil.move(next((FOLDER / "bag").glob("*.mcap")), FOLDER / "jaw.mcap")
shutil.rmtree(FOLDER / "bag")

# Chunks in lz4; commands without a stamp at half the rate, poses of a tip that leans by the jaw's angle, and a type that is left out.
with open(FOLDER / "rates.mcap", "wb") as file:
    writer = Ros2Writer(file, chunk_size=8192, compression=CompressionType.LZ4)
    array = "std_msgs/MultiArrayLayout layout\nfloat64[] data\n" + "=" * 80 + "\nMSG: std_msgs/MultiArrayLayout\nstd_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n" + "=" * 80 + "\nMSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n"
    head = "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    pose = "std_msgs/Header header\ngeometry_msgs/Pose pose\n" + head + "=" * 80 + "\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n" + "=" * 80 + "\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n" + "=" * 80 + "\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    arrays = writer.register_msgdef("std_msgs/msg/Float64MultiArray", array)
    poses = writer.register_msgdef("geometry_msgs/msg/PoseStamped", pose)
    texts = writer.register_msgdef("std_msgs/msg/String", "string data\n")
    for k, (stamp, u, y) in enumerate(zip(stamps_ns, np.deg2rad(u_deg), np.deg2rad(y_deg))):
        log = int(stamp)
        if k % 2 == 0:
            message = {"layout": {"dim": [], "data_offset": 0}, "data": [u, 0.5 * u]}
            writer.write_message("/controller/commands", arrays, message, log_time=log, publish_time=log)
        half = 0.5 * y
        message = {
            "header": {"stamp": {"sec": log // 10**9, "nanosec": log % 10**9}, "frame_id": "base"},
            "pose": {
                "position": {"x": 0.01 * np.sin(y), "y": 0.0, "z": 0.01 * np.cos(y)},
                "orientation": {"x": 0.0, "y": np.sin(half), "z": 0.0, "w": np.cos(half)},
            },
        }
        writer.write_message("/tip/pose", poses, message, log_time=log, publish_time=log)
        if k % 50 == 0:
            writer.write_message("/rosout", texts, {"data": "hello"}, log_time=log, publish_time=log)
    writer.finish()
