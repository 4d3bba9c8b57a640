#!/usr/bin/env python3
"""The robot of a recording by another's kinematics: robot.urdf with the joint angles of /joint_states against the frames of /tf.

  pip install yourdfpy mcap mcap-protobuf-support
  python3 urdf_check.py out/plan/plan.mcap

The URDF is the recording's attachment. Prints the largest differences of nozzle position (metres) and spray axis (radians) over the recording,
and what else is attached. Exit code 1 above 1e-6."""

import io
import json
import sys

import numpy
import yourdfpy
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def matrix(frame):
    """Of a FrameTransform."""
    t, q = frame.translation, frame.rotation
    x, y, z, w = q.x, q.y, q.z, q.w
    return numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t.x],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t.y],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t.z],
        [0, 0, 0, 1],
    ])


def main():
    path = sys.argv[1]
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        attached = {a.name: a.data for a in reader.iter_attachments()}
        described = {m.name: m.metadata for m in reader.iter_metadata()}
        robot = yourdfpy.URDF.load(io.BytesIO(attached["robot.urdf"]))
        frames, position, angle, count = None, 0.0, 0.0, 0
        for _, channel, _, message in reader.iter_decoded_messages(["/tf", "/joint_states"]):
            if channel.topic == "/tf":
                frames = {frame.child_frame_id: matrix(frame) for frame in message.transforms}
                continue
            # The valve stands beside the joints, and is none of the robot's.
            joints = {joint.name: joint.position for joint in message.joints if joint.name in robot.joint_map}
            robot.update_cfg({name: joints[name] for name in robot.actuated_joint_names})
            ours = frames["pan"] @ frames["tilt"] @ frames["nozzle"]
            theirs = robot.get_transform("nozzle", "body")
            position = max(position, numpy.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
            angle = max(angle, numpy.linalg.norm(numpy.cross(ours[:3, 0], theirs[:3, 0])))
            count += 1
    print(json.dumps({
        "file": path, "states": count, "position_m": position, "spray_axis_rad": angle,
        "attached": sorted(attached), "metadata": described,
    }))
    sys.exit(int(count == 0 or position > 1e-6 or angle > 1e-6))


if __name__ == "__main__":
    main()
