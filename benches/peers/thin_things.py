#!/usr/bin/env python3
"""Thin things before a wall, mapped by `scan` and by Open3D's VoxelBlockGrid from the same depth with the same poses: how much of what the
camera saw of each thing is in the mesh, and how much of the mesh is no surface. Prints one JSON line per stream, voxel size and side.
Needs numpy and open3d (pip install open3d==0.20.0).

    python3 thin_things.py FOLDER --scan PROGRAM                            all streams at 2 and 1 cm
    python3 thin_things.py FOLDER --scan PROGRAM --streams pass --voxel 0.02 --pictures

Things (metres, z up): rods of 20, 10, 6 and 4 mm, three slats of 40 x 8 mm and two of 20 x 4 mm, a mug with a wall of 3 mm, a rim and a handle, two wires
of 3 mm, a plate of 3 mm; a table, and a wall 0.5 m behind. Cameras: `pass` moves 1.2 m sideways, `turn` goes through 100 degrees before the things,
`around` once round them (no wall). `-noise` adds the axial noise of synth_rgbd.py.
Complete: share of the points that the camera saw of a thing (the exact depth of every 3rd pixel) within half a voxel of the mesh. False:
share of the mesh's area nearer than 0.1 m to a thing and farther than a voxel from every surface. Open3D reads pixel centres half a
pixel off; it gets the intrinsics that undo this.
"""

import argparse
import json
import math
import os
import subprocess

import numpy as np
import open3d as o3d
import synth_rgbd as g

FRAMES = 48


class Cylinder:
    """From a to b, solid, or a pipe with an inner radius that is closed up to `bottom`."""

    def __init__(self, name, a, b, radius, inner=0.0, bottom=0.0):
        self.name, self.a, self.radius, self.inner, self.bottom = name, np.array(a, float), radius, inner, bottom
        axis = np.array(b, float) - self.a
        self.length = np.linalg.norm(axis)
        z = axis / self.length
        x = np.cross(z, [0.31, 0.87, 0.4])
        x /= np.linalg.norm(x)
        self.frame = np.stack([x, np.cross(z, x), z], 1)

    def cast(self, o, d):
        o, d = (o - self.a) @ self.frame, d @ self.frame
        best = np.full(len(d), np.inf)
        a, b = d[:, 0] ** 2 + d[:, 1] ** 2, d[:, 0] * o[0] + d[:, 1] * o[1]
        for radius, low in [(self.radius, 0.0), (self.inner, self.bottom)]:
            root = b * b - a * (o[0] ** 2 + o[1] ** 2 - radius**2)
            for sign in (-1, 1) if radius else ():
                t = (-b + sign * np.sqrt(np.maximum(root, 0))) / a
                z = o[2] + t * d[:, 2]
                best = np.where((root > 0) & (t > 1e-6) & (t < best) & (z > low) & (z < self.length), t, best)
        for z, low in [(0.0, 0.0), (self.length, self.inner), (self.bottom, 0.0)]:
            t = (z - o[2]) / d[:, 2]
            r = np.hypot(o[0] + t * d[:, 0], o[1] + t * d[:, 1])
            best = np.where((t > 1e-6) & (t < best) & (r > low) & (r < self.radius), t, best)
        return best

    def distance(self, p):
        p = (p - self.a) @ self.frame
        r, z = np.hypot(p[:, 0], p[:, 1]), p[:, 2]

        def box(x, y):
            return np.hypot(np.maximum(x, 0), np.maximum(y, 0)) + np.minimum(np.maximum(x, y), 0)

        outer = box(r - self.radius, np.abs(z - self.length / 2) - self.length / 2)
        return np.maximum(outer, -box(r - self.inner, self.bottom - z)) if self.inner else outer


class Box:
    """Half extents h, turned about z by an angle."""

    def __init__(self, name, centre, h, yaw=0.0):
        self.name, self.centre, self.h = name, np.array(centre, float), np.array(h, float)
        c, s = math.cos(yaw), math.sin(yaw)
        self.frame = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])

    def cast(self, o, d):
        o, d = (o - self.centre) @ self.frame, d @ self.frame
        t1, t2 = (-self.h - o) / d, (self.h - o) / d
        near, far = np.minimum(t1, t2).max(1), np.maximum(t1, t2).min(1)
        return np.where((near < far) & (near > 1e-6), near, np.inf)

    def distance(self, p):
        q = np.abs((p - self.centre) @ self.frame) - self.h
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)


def things():
    out = []
    for x, mm in zip([-0.55, -0.47, -0.40, -0.34], [20, 10, 6, 4]):
        out.append(Cylinder(f"rod_{mm}mm", [x, 0.02, 0.8], [x + 0.05, -0.01, 1.35], mm / 2000))
    for k in range(3):
        out.append(Box("slats_8mm", [-0.16, 0.0, 1.0 + 0.11 * k], [0.12, 0.004, 0.02], 0.3))
    for k in range(2):
        out.append(Box("slats_4mm", [-0.16, 0.0, 1.055 + 0.11 * k], [0.12, 0.002, 0.01], 0.3))
    out.append(Cylinder("mug", [0.15, -0.05, 0.8003], [0.15, -0.05, 0.9], 0.041, 0.038, 0.004))
    for k in range(8):
        a = [-1.35 + 2.7 * (k + n) / 8 for n in (0, 1)]
        ends = [[0.18 + 0.032 * math.cos(t), -0.055, 0.85 + 0.032 * math.sin(t)] for t in a]
        out.append(Cylinder("mug", *ends, 0.005))
    out.append(Cylinder("wires_3mm", [0.02, 0.0, 1.34], [0.62, 0.03, 1.22], 0.0015))
    out.append(Cylinder("wires_3mm", [0.02, 0.0, 1.12], [0.62, 0.05, 1.16], 0.0015))
    out.append(Box("plate_3mm", [0.45, 0.0, 0.95], [0.08, 0.0015, 0.12], -0.4))
    return out


def background(stream):
    table = Box("table", [0, 0, 0.78], [0.75, 0.3, 0.02])
    return [table] if stream == "around" else [table, Box("wall", [0, 0.6, 1.0], [2.5, 0.1, 1.5])]


def look(c, at):
    f = np.array(at) - c
    f /= np.linalg.norm(f)
    r = np.cross(f, [0, 0, 1.0])
    r /= np.linalg.norm(r)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.stack([r, np.cross(f, r), f], 1), c
    return T


def poses(stream):
    out = []
    for k in range(FRAMES):
        s = k / (FRAMES - 1)
        if stream == "pass":
            x = -0.6 + 1.2 * s
            out.append(look(np.array([x, -1.1, 1.2 + 0.1 * math.sin(5 * s)]), [0.8 * x, 0.0, 1.05]))
        else:
            a = math.radians(-50 + 100 * s) if stream == "turn" else 2 * math.pi * k / FRAMES
            out.append(look(np.array([1.2 * math.sin(a), -1.2 * math.cos(a), 1.35]), [0.0, 0.0, 1.03]))
    return out


class Stream:
    def __init__(self, name, folder):
        kind, _, noise = name.partition("-")
        self.name, self.folder = name, os.path.join(folder, name)
        self.things, self.poses = things() + background(kind), poses(kind)
        for sub in ("depth", "rgb"):
            os.makedirs(os.path.join(self.folder, sub), exist_ok=True)
        self.depth, self.colour, seen = [], [], []
        names = sorted({t.name for t in self.things})
        for i, T in enumerate(self.poses):
            d, o = g.rays(T[:3, :3]), T[:3, 3]
            z, ident = np.full(len(d), np.inf), np.zeros(len(d), int)
            for t in self.things:
                hit = t.cast(o, d)
                ident, z = np.where(hit < z, names.index(t.name) + 1, ident), np.minimum(hit, z)
            exact = z.copy()
            if noise:
                idx = (np.arange(g.W * g.H, dtype=np.uint64) + np.uint64(i * g.W * g.H)) * np.uint64(4)
                u = sum((g.splitmix(idx + np.uint64(k)) >> np.uint64(11)).astype(np.float64) * 2.0**-53 for k in range(4))
                z = z + (0.0012 + 0.0019 * (z - 0.4) ** 2) * (u - 2) * math.sqrt(3)
            z = np.where(z < 6.0, z, 0.0)
            self.depth.append(np.round(z * 1000).astype(np.uint16).reshape(g.H, g.W))
            shade = (60 + 17 * ident % 160)[:, None] * np.array([1.0, 0.9, 0.8])
            self.colour.append(shade.astype(np.uint8).reshape(g.H, g.W, 3))
            pick = np.zeros((g.H, g.W), bool)
            pick[i % 3 :: 3, i % 2 :: 3] = True
            pick = pick.ravel() & (exact < 6.0)
            seen.append((ident[pick] - 1, o + exact[pick, None] * d[pick]))
        idents, points = np.concatenate([s[0] for s in seen]), np.concatenate([s[1] for s in seen])
        self.seen = {n: points[idents == k] for k, n in enumerate(names) if (idents == k).any()}
        self.write()

    def write(self):
        def text(name, lines):
            with open(os.path.join(self.folder, name), "w") as f:
                f.write("\n".join(lines) + "\n")

        for i, (d, c) in enumerate(zip(self.depth, self.colour)):
            g.write_png(f"{self.folder}/depth/{i:04d}.png", d)
            g.write_png(f"{self.folder}/rgb/{i:04d}.png", c)
        row = [" ".join(f"{x:.9f}" for x in [*T[:3, 3], *g.quat(T[:3, :3])]) for T in self.poses]
        text("groundtruth.txt", [f"{i / 30:.6f} {r}" for i, r in enumerate(row)])
        text("intrinsics.txt", [f"{g.W} {g.H} {g.FX} {g.FY} {g.CX} {g.CY} 1000"])
        for k in ("depth", "rgb"):
            text(k + ".txt", [f"{i / 30:.6f} {k}/{i:04d}.png" for i in range(len(self.poses))])

    def distance(self, p):
        return np.min([np.abs(t.distance(p)) for t in self.things], axis=0)

    def near_things(self, p):
        solid = [t.distance(p) for t in self.things if t.name not in ("table", "wall")]
        return np.min(solid, axis=0) < 0.1


def ours(stream, voxel, program):
    out = os.path.join(stream.folder, f"ours_{voxel:g}")
    command = [program, "--sequence", stream.folder, "--voxel", str(voxel), "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stderr.strip()[-2000:]}")
    m = o3d.io.read_triangle_mesh(out + "/mesh.ply")
    return np.asarray(m.vertices), np.asarray(m.triangles)


def open3d(stream, voxel):
    c, t = o3d.core, o3d.t.geometry
    k = c.Tensor(np.array([[g.FX, 0, g.CX + 0.5], [0, g.FY, g.CY + 0.5], [0, 0, 1.0]]))
    grid = t.VoxelBlockGrid(
        ("tsdf", "weight", "color"), (c.float32,) * 3, ((1), (1), (3)), voxel_size=voxel, block_resolution=16, block_count=20000
    )
    for d, rgb, T in zip(stream.depth, stream.colour, stream.poses):
        z, rgb, e = t.Image(c.Tensor(d)), t.Image(c.Tensor(rgb)), c.Tensor(np.linalg.inv(T))
        blocks = grid.compute_unique_block_coordinates(z, k, e, 1000.0, 6.0, 4.0)
        grid.integrate(blocks, z, rgb, k, k, e, 1000.0, 6.0, 4.0)
    m = grid.extract_triangle_mesh(weight_threshold=0.5)
    return m.vertex.positions.numpy().astype(float), m.triangle.indices.numpy()


def scene_of(v, t):
    c = o3d.core
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(c.Tensor(v.astype(np.float32)), c.Tensor(t.astype(np.uint32)))
    return scene


def judge(stream, voxel, v, t):
    scene, out = scene_of(v, t), {}
    for name, points in stream.seen.items():
        near = scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
        out[name] = round(float((near < voxel / 2).mean()), 4)
    a, b, d = (v[t[:, k]] for k in range(3))
    area, middle = np.linalg.norm(np.cross(b - a, d - a), axis=1) / 2, (a + b + d) / 3
    beside = stream.near_things(middle)
    off = stream.distance(middle)
    bad = area[beside & (off > voxel)].sum()
    errors = stream.distance(v)[stream.near_things(v)] * 1000
    return out, dict(
        false_share=round(float(bad / area[beside].sum()), 4),
        near_area_m2=round(float(area[beside].sum()), 4),
        error_mean_mm=round(float(errors.mean()), 3),
        error_p95_mm=round(float(np.percentile(errors, 95)), 3),
    )


def picture(path, stream, v, t):
    """The mesh as the camera in the middle of the stream sees it, shaded by its normals."""
    T, scale = stream.poses[len(stream.poses) // 2], 2
    d = g.rays(T[:3, :3], 1).reshape(g.H, g.W, 3)
    v0, u0 = np.mgrid[0 : g.H : 1 / scale, 0 : g.W : 1 / scale]
    d = np.stack([(u0 - g.CX) / g.FX, (v0 - g.CY) / g.FY, np.ones_like(u0)], -1) @ T[:3, :3].T
    ray = np.concatenate([np.broadcast_to(T[:3, 3], d.shape), d], -1).astype(np.float32)
    hit = scene_of(v, t).cast_rays(o3d.core.Tensor(ray))
    n, far = hit["primitive_normals"].numpy(), np.isfinite(hit["t_hit"].numpy())
    front = (n * d).sum(-1) < 0
    shade = np.abs(n @ np.array([0.35, -0.75, 0.55]))
    grey = np.where(far, 40 + 200 * shade, 20)
    img = np.stack([grey, np.where(front | ~far, grey, 60), np.where(front | ~far, grey, 60)], -1)
    g.write_png(path, np.clip(img, 0, 255).astype(np.uint8))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("folder")
    p.add_argument("--scan", required=True, help="the program")
    p.add_argument("--streams", nargs="+", default=["pass", "turn", "around", "pass-noise", "turn-noise", "around-noise"])
    p.add_argument("--voxel", type=float, nargs="+", default=[0.02, 0.01])
    p.add_argument("--pictures", action="store_true", help="PNG of both meshes beside them")
    o = p.parse_args()
    for name in o.streams:
        stream = Stream(name, o.folder)
        for voxel in o.voxel:
            rows = {}
            for side, mesh in [("ours", ours(stream, voxel, o.scan)), ("open3d", open3d(stream, voxel))]:
                complete, figures = judge(stream, voxel, *mesh)
                rows[side] = complete
                print(json.dumps(dict(stream=name, voxel_m=voxel, side=side, **figures, **complete)), flush=True)
                if o.pictures:
                    picture(f"{stream.folder}/{side}_{voxel:g}.png", stream, *mesh)
            less = {k: f"{rows['ours'][k]} < {x}" for k, x in rows["open3d"].items() if rows["ours"][k] < x}
            print(json.dumps(dict(stream=name, voxel_m=voxel, less_than_open3d=less)), flush=True)


if __name__ == "__main__":
    main()
