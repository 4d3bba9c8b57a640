"""A vehicle played by pymavlink: it flies where `robot --autopilot udp:...` or `serial:...` tells it, and checks each message by an outside decoder.

    python3 benches/peers/mavlink_vehicle.py ROBOT [SECONDS [serial]]     # ROBOT: the program; paints SECONDS of a small panel (5)

The vehicle is a point that follows its set-points; its pilot arms it and hands over control after two seconds. Checked are frames, masks,
units, targets, and that what is decoded brings it where the plan is. Exit code 1 with what is wrong. Needs pymavlink.
"""

import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import tty

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mav

PORT = 14777


class Line(mavutil.mavfile):
    """The far end of a serial line: a pseudo-terminal."""

    def __init__(self):
        master, self.near = os.openpty()
        tty.setraw(self.near)
        os.set_blocking(master, False)
        super().__init__(master, os.ttyname(self.near), source_system=7, source_component=1)

    def recv(self, n=None):
        try:
            return os.read(self.fd, n or 4096)
        except BlockingIOError:
            return b""

    def write(self, buf):
        try:
            os.write(self.fd, buf)
        except BlockingIOError:
            pass


def panel(path):
    n = 10
    rows = [f"v 0 {0.5 - i / n} {1 + j / n}" for j in range(n + 1) for i in range(n + 1)]
    for j in range(n):
        for i in range(n):
            a = j * (n + 1) + i + 1
            rows += [f"f {a} {a + 1} {a + n + 2}", f"f {a} {a + n + 2} {a + n + 1}"]
    path.write_text("\n".join(rows) + "\n")


def main():
    robot, seconds = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "5"
    folder = pathlib.Path(tempfile.mkdtemp())
    panel(folder / "panel.obj")
    serial = sys.argv[3:] == ["serial"]
    link = Line() if serial else mavutil.mavlink_connection(f"udpout:127.0.0.1:{PORT}", source_system=7, source_component=1)
    address = f"serial:{link.address},115200" if serial else f"udp:127.0.0.1:{PORT}"
    command = [robot, "--autopilot", address, "--mesh", folder / "panel.obj", "--scale", "1", "--up", "z"]
    command += ["--design", "stripes", "--seconds", seconds, "--out", folder / "out"]
    running = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    # North, east, down and heading; it starts somewhere else than the plan.
    place, velocity, yaw = [3.0, -2.0, 0.0], [0.0] * 3, 0.4
    counts, wrong, landing, armed, start, farthest = {}, [], False, False, time.time(), 0.0
    check = lambda ok, what: ok or wrong.append(what)
    while running.poll() is None and time.time() - start < 180:
        now = time.time() - start
        while (message := link.recv_match(blocking=False)) is not None:
            kind = message.get_type()
            counts[kind] = counts.get(kind, 0) + 1
            if kind == "SET_POSITION_TARGET_LOCAL_NED":
                check(message.coordinate_frame == mav.MAV_FRAME_LOCAL_NED, "frame of the set-point")
                check(message.type_mask == 2048, f"mask {message.type_mask}")
                check((message.target_system, message.target_component) == (7, 1), "target of the set-point")
                values = [message.x, message.y, message.z, message.vx, message.vy, message.vz, message.afx, message.afy, message.afz]
                check(all(map(math.isfinite, values + [message.yaw])), "a set-point that is not finite")
                step = math.dist(place, values[:3])
                if armed and not landing:
                    check(step < 0.5, f"the set-point jumps by {step:.2f} m")
                    place, velocity, yaw = list(values[:3]), list(values[3:6]), message.yaw
                    farthest = max(farthest, -place[2])
            elif kind == "HEARTBEAT":
                check(message.type == mav.MAV_TYPE_ONBOARD_CONTROLLER and message.autopilot == mav.MAV_AUTOPILOT_INVALID, "heartbeat")
            elif kind == "COMMAND_LONG":
                known = (mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAV_CMD_DO_SET_MODE)
                check(message.command in known, f"command {message.command}: a vehicle is armed by its pilot")
                if message.command == mav.MAV_CMD_DO_SET_MODE:
                    check((message.param1, message.param2, message.param3) == (1, 4, 6), "mode that is not landing")
                    landing = True
            elif kind == "BAD_DATA":
                wrong.append("a frame that cannot be decoded")
            elif kind not in ("TIMESYNC",):
                wrong.append(f"{kind} was not expected")
        if landing and armed:
            place[2], velocity = min(place[2] + 0.02, 0.0), [0.0] * 3
            armed = place[2] < 0.0
        elif not landing:
            armed = now > 6.0
        boot = int(now * 1000)
        main_mode = (4 << 16) + (6 << 24) if landing else (6 << 16 if armed else 1 << 16)
        base = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mav.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
        link.mav.heartbeat_send(mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4, base, main_mode, mav.MAV_STATE_ACTIVE)
        link.mav.attitude_quaternion_send(boot, math.cos(yaw / 2), 0, 0, math.sin(yaw / 2), 0, 0, 0)
        link.mav.local_position_ned_send(boot, *place, *velocity)
        link.mav.estimator_status_send(boot * 1000, 0x3F, 0, 0, 0, 0, 0, 0, 0, 0)
        time.sleep(0.01)
    running.kill()
    print("decoded:", ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())))
    check(running.wait() == 0, f"robot ended with {running.returncode}")
    check(counts.get("SET_POSITION_TARGET_LOCAL_NED", 0) > 500, "too few set-points")
    check(0.8 < farthest < 2.2, f"the plan was flown at {farthest:.2f} m above the start")
    print("all as the standard says" if not wrong else "wrong: " + "; ".join(sorted(set(wrong))))
    sys.exit(1 if wrong else 0)


main()
