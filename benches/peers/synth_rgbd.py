#!/usr/bin/env python3
"""Deterministic RGB-D stream of an analytic room, written as a TUM-like folder. Needs numpy only.

    python3 synth_rgbd.py OUT --preset loop            60 frames, full loop, clean depth
    python3 synth_rgbd.py OUT --frames 4 --noise       any length, Kinect-like axial noise
    python3 synth_rgbd.py OUT --preset loop --odometry 2 0.03 1    and an odometry that is off by 2 deg and 3 cm per frame

Scene (metres, z up): the inside of the box [-3,3] x [-2,2] x [0,3], four spheres, four axis-aligned boxes. `sdf(p)` is the exact distance
near the surfaces (a lower bound deep inside objects), `cast(o, d)` the exact first hit: together they are the ground truth of a map.
Camera: OpenCV axes (x right, y down, z forward), 640x480, fx = fy = 525, cx = 319.5, cy = 239.5; the CENTRE of pixel (u,v) is at (u,v),
so the image spans [-0.5, 639.5]: a reader that floors instead of rounding loses half a pixel.
Depth: z along the optical axis, u16 = round(z * scale), scale 1000 (or --depth-scale 5000, the value of the TUM benchmark).
Noise (--noise): z += sigma(z) * n, sigma = 0.0012 + 0.0019 (z-0.4)^2 m, n = sqrt(3) (u0+u1+u2+u3-2) (unit variance, bounded),
  u_k = (splitmix64(4*(i*W*H + v*W + u) + k) >> 11) * 2^-53 with i the frame, splitmix64(x) = the usual finaliser of x + 0x9E3779B97F4A7C15.
--world X Y Z YAW_DEG writes the poses in a moved world (same images): with all zeros the room's walls lie exactly on the voxel planes of
  a 5/10/20 mm grid, a degenerate case worth testing on its own and worth leaving in an accuracy run.
Files: depth/NNNN.png rgb/NNNN.png depth.txt rgb.txt (timestamp path), groundtruth.txt (t tx ty tz qx qy qz qw, world_from_camera),
  intrinsics.txt (W H fx fy cx cy depth_scale), world.txt (X Y Z YAW_DEG), checksum.txt (sha256 of all decoded depth pixels, u16 LE, frame after frame).
"""

import argparse
import hashlib
import math
import os
import struct
import zlib

import numpy as np

W, H, FX, FY, CX, CY = 640, 480, 525.0, 525.0, 319.5, 239.5
ROOM_LO, ROOM_HI = np.array([-3.0, -2.0, 0.0]), np.array([3.0, 2.0, 3.0])
SPHERES = np.array(
    [[2.10, 1.10, 0.50, 0.50], [-2.20, 1.20, 0.35, 0.35], [-2.30, -1.20, 1.40, 0.40], [0.30, 1.55, 1.80, 0.30]]
)
BOXES = np.array(
    [
        [1.60, -2.00, 0.00, 2.80, -1.30, 0.75],  # desk at the wall
        [-3.00, -0.40, 0.00, -2.50, 0.50, 1.90],  # wardrobe
        [-0.60, -1.70, 0.00, 0.20, -1.20, 0.45],  # crate
        [2.60, -0.30, 0.90, 2.90, 0.50, 1.30],
    ]
)  # shelf
PRESETS = {
    "loop": (60, 360.0, False),
    "loop-noise": (60, 360.0, True),
    "arc": (60, 60.0, False),
    "arc-noise": (60, 60.0, True),
}
KNOWN = {
    "loop": "8ce425e13aadede4",
    "loop-noise": "b52d5ace111dc9e3",
    "arc": "8991c9ec76932c32",
    "arc-noise": "8239c22a7875e3b7",
}


def sdf(p):
    """Signed distance (m) of points (N,3), positive in free space."""
    d = np.minimum(p - ROOM_LO, ROOM_HI - p)
    inside = d.min(1)
    r = np.where(inside > 0, inside, -np.linalg.norm(np.maximum(-d, 0), axis=1))
    for s in SPHERES:
        r = np.minimum(r, np.linalg.norm(p - s[:3], axis=1) - s[3])
    for b in BOXES:
        q = np.abs(p - (b[:3] + b[3:]) / 2) - (b[3:] - b[:3]) / 2
        r = np.minimum(r, np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0))
    return r


def cast(o, d):
    """First hit along o + t d, o (3,), d (N,3) not normalised. Returns t (N,) and the object's id (N,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inv = 1.0 / d
        t = np.where(d > 0, (ROOM_HI - o) * inv, (ROOM_LO - o) * inv).min(1)
        ident = np.zeros(len(d), int)
        for k, b in enumerate(BOXES):
            t1, t2 = (b[:3] - o) * inv, (b[3:] - o) * inv
            near, far = np.minimum(t1, t2).max(1), np.maximum(t1, t2).min(1)
            m = (near < far) & (near > 1e-6) & (near < t)
            t, ident = np.where(m, near, t), np.where(m, 10 + k, ident)
        a = (d * d).sum(1)
        for k, c in enumerate(SPHERES):
            oc = o - c[:3]
            b_, cc = d @ oc, oc @ oc - c[3] ** 2
            disc = b_ * b_ - a * cc
            s = np.where(disc > 0, (-b_ - np.sqrt(np.maximum(disc, 0))) / a, np.inf)
            m = (s > 1e-6) & (s < t)
            t, ident = np.where(m, s, t), np.where(m, 20 + k, ident)
    return t, ident


def normal(p):
    e = 1e-5
    g = np.stack([sdf(p + e * np.eye(3)[i]) - sdf(p - e * np.eye(3)[i]) for i in range(3)], 1)
    return g / np.maximum(np.linalg.norm(g, axis=1, keepdims=True), 1e-12)


def hash3(x, y, z):
    h = (x.astype(np.int64) * 73856093) ^ (y.astype(np.int64) * 19349663) ^ (z.astype(np.int64) * 83492791)
    h = (h ^ (h >> 13)) * 1274126177
    return ((h ^ (h >> 16)) & 0xFFFF) / 65535.0


def colour(p, ident):
    """Two-scale block texture with a fixed light; RGB in 0..1."""
    n = normal(p)
    c, f = np.floor(p / 0.25 + 1e-4).astype(np.int64), np.floor(p / 0.05 + 1e-4).astype(np.int64)
    v = 0.35 + 0.40 * hash3(c[:, 0], c[:, 1], c[:, 2]) + 0.20 * hash3(f[:, 0] + 7, f[:, 1] + 11, f[:, 2] + 13)
    shade = 0.65 + 0.35 * np.abs(n @ np.array([0.3, 0.2, 0.93]))
    tint = np.stack(
        [
            0.75 + 0.25 * np.cos(ident * 1.7),
            0.75 + 0.25 * np.cos(ident * 2.9 + 2),
            0.75 + 0.25 * np.cos(ident * 0.9 + 4),
        ],
        1,
    )
    return np.clip(v[:, None] * shade[:, None] * tint, 0, 1)


def pose(th):
    """Camera on the ellipse 0.9 x 0.5 m, height 1.3 + 0.25 sin 2th, looking outward, pitch -12 + 18 sin 3th deg. (R,
    c) of scene_from_camera."""
    c = np.array([0.9 * math.cos(th), 0.5 * math.sin(th), 1.30 + 0.25 * math.sin(2 * th)])
    pit = math.radians(-12 + 18 * math.sin(3 * th))
    f = np.array([math.cos(th) * math.cos(pit), math.sin(th) * math.cos(pit), math.sin(pit)])
    r = np.cross(f, [0, 0, 1.0])
    r /= np.linalg.norm(r)
    return np.stack([r, np.cross(f, r), f], 1), c


def quat(R):
    """x y z w"""
    t = np.trace(R)
    if t > 0:
        s = math.sqrt(t + 1) * 2
        return np.array([(R[2, 1] - R[1, 2]) / s, (R[0, 2] - R[2, 0]) / s, (R[1, 0] - R[0, 1]) / s, s / 4])
    i = int(np.argmax(np.diag(R)))
    j, k = (i + 1) % 3, (i + 2) % 3
    s = math.sqrt(1 + R[i, i] - R[j, j] - R[k, k]) * 2
    q = np.zeros(4)
    q[i] = s / 4
    q[3] = (R[k, j] - R[j, k]) / s
    q[j] = (R[j, i] + R[i, j]) / s
    q[k] = (R[k, i] + R[i, k]) / s
    return q


def splitmix(x):
    with np.errstate(over="ignore"):
        x = x + np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return x ^ (x >> np.uint64(31))


def rays(R, step=1):
    """Directions with unit z in the camera frame, rotated by R; (N,3), row-major over pixels."""
    u, v = np.meshgrid(np.arange(0, W, step), np.arange(0, H, step))
    return np.stack([(u - CX) / FX, (v - CY) / FY, np.ones_like(u, float)], -1).reshape(-1, 3) @ R.T


def offset_matrix(x=0.0, y=0.0, z=0.0, yaw_deg=0.0):
    """world_from_scene"""
    a = math.radians(yaw_deg)
    M = np.eye(4)
    M[:2, :2] = [[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]
    M[:3, 3] = x, y, z
    return M


def write_png(path, img):
    """u16 (H,W) grey or u8 (H,W,3) RGB, no filters."""
    bits, ctype = (16, 0) if img.dtype == np.uint16 else (8, 2)
    raw = img.astype(">u2").view(np.uint8).reshape(len(img), -1) if bits == 16 else img.reshape(len(img), -1)
    data = zlib.compress(np.concatenate([np.zeros((len(img), 1), np.uint8), raw], 1).tobytes(), 6)

    def chunk(tag, body):
        return struct.pack(">I", len(body)) + tag + body + struct.pack(">I", zlib.crc32(tag + body))

    with open(path, "wb") as f:
        f.write(
            b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", struct.pack(">IIBBBBB", img.shape[1], len(img), bits, ctype, 0, 0, 0))
            + chunk(b"IDAT", data)
            + chunk(b"IEND", b"")
        )


def with_errors(poses, deg, metres, seed):
    """Motions between world_from_camera matrices, each with an error on its right side, put together again."""
    random, out = np.random.default_rng(int(seed)), [poses[0]]
    for before, now in zip(poses, poses[1:]):
        w, t = random.normal(0, math.radians(deg), 3), random.normal(0, metres, 3)
        a = np.linalg.norm(w)
        K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]) / a
        E = np.eye(4)
        E[:3, :3] = np.eye(3) + math.sin(a) * K + (1 - math.cos(a)) * K @ K
        E[:3, 3] = t
        out.append(out[-1] @ np.linalg.inv(before) @ now @ E)
    return out


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("out")
    a.add_argument("--preset", choices=PRESETS, help="loop: 6 deg/frame; arc: 1 deg/frame over 0.734 m (tracking)")
    a.add_argument("--frames", type=int, default=60)
    a.add_argument("--arc", type=float, default=360.0, metavar="DEG")
    a.add_argument("--noise", action="store_true")
    a.add_argument("--no-colour", action="store_true", help="skip rgb/ (four times faster)")
    a.add_argument("--depth-scale", type=float, default=1000.0)
    a.add_argument(
        "--odometry", type=float, nargs=3, metavar=("DEG", "METRES", "SEED"),
        help="also odometry.txt: the motions of groundtruth.txt with normal errors about and along each axis",
    )
    a.add_argument("--world", type=float, nargs=4, default=[0, 0, 0, 0], metavar=("X", "Y", "Z", "YAW_DEG"))
    o = a.parse_args()
    if o.preset:
        o.frames, o.arc, o.noise = PRESETS[o.preset]
    if o.frames < 1:
        a.error("--frames must be at least 1")
    if not 1 <= o.depth_scale <= 10000:
        a.error("--depth-scale must lie in 1..10000 so that 6 m fits 16 bits")
    os.makedirs(o.out + "/depth", exist_ok=True)
    if not o.no_colour:
        os.makedirs(o.out + "/rgb", exist_ok=True)
    M, sha, poses = offset_matrix(*o.world), hashlib.sha256(), []
    for i in range(o.frames):
        R, c = pose(math.radians(o.arc) * i / o.frames)
        d = rays(R)
        t, ident = cast(c, d)
        z = t.copy()
        if o.noise:
            idx = (np.arange(W * H, dtype=np.uint64) + np.uint64(i) * np.uint64(W * H)) * np.uint64(4)
            u = sum((splitmix(idx + np.uint64(k)) >> np.uint64(11)).astype(np.float64) * 2.0**-53 for k in range(4))
            z = z + (0.0012 + 0.0019 * (z - 0.4) ** 2) * (u - 2) * math.sqrt(3)
        depth = np.round(z * o.depth_scale).astype(np.uint16).reshape(H, W)
        sha.update(depth.astype("<u2").tobytes())
        write_png(f"{o.out}/depth/{i:04d}.png", depth)
        if not o.no_colour:
            write_png(
                f"{o.out}/rgb/{i:04d}.png",
                (colour(c + t[:, None] * d, ident) * 255 + 0.5).astype(np.uint8).reshape(H, W, 3),
            )
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = M[:3, :3] @ R, M[:3, :3] @ c + M[:3, 3]
        poses.append(T)

    def tum(poses):
        return [
            f"{i / 30:.6f} " + " ".join(f"{x:.9f}" for x in [*T[:3, 3], *quat(T[:3, :3])]) for i, T in enumerate(poses)
        ]

    def text(name, lines):
        open(f"{o.out}/{name}", "w").write("\n".join(lines) + "\n")

    text("groundtruth.txt", tum(poses))
    if o.odometry:
        text("odometry.txt", tum(with_errors(poses, *o.odometry)))
    text("intrinsics.txt", [f"{W} {H} {FX} {FY} {CX} {CY} {o.depth_scale:g}"])
    text("world.txt", [" ".join(f"{x:.9g}" for x in o.world)])
    text("checksum.txt", [sha.hexdigest()])
    for k in ["depth"] + ([] if o.no_colour else ["rgb"]):
        text(k + ".txt", [f"{i / 30:.6f} {k}/{i:04d}.png" for i in range(o.frames)])
    known = KNOWN.get(o.preset) if o.depth_scale == 1000 else None
    print(
        f"{o.frames} frames in {o.out}; depth sha256 {sha.hexdigest()[:16]}"
        + (
            f" (expected {known}: {'same' if sha.hexdigest().startswith(known) else 'DIFFERENT, see the libm'})"
            if known
            else ""
        )
    )


if __name__ == "__main__":
    main()
