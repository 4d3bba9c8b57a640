#!/usr/bin/env python3
"""A mesh of a recording in the 7-Scenes layout against the recording itself, and Open3D's mesh of the same frames beside it.
Prints one JSON line per mesh. Needs numpy, pillow and open3d (pip install open3d==0.19.0 pillow).

    python3 recorded_surface.py KITCHEN --voxel 0.02 --file ours.ply        ours, then Open3D's VoxelBlockGrid
    python3 recorded_surface.py KITCHEN --voxel 0.02 --out open3d.ply       Open3D's alone, kept

near_10mm: share of the measured points (every 7th pixel of every 4th frame, nearer than --max-depth) within 10 mm of the mesh: what is
missing lowers it. unsupported_area: share of the mesh's area whose triangles lie more than 20 mm from every measured point: what was
invented raises it. Both run with the poses given; truncation is four voxels.
"""

import argparse
import glob
import json

import numpy as np
import open3d as o3d
from PIL import Image


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("sequence")
    p.add_argument("--voxel", type=float, default=0.02)
    p.add_argument("--max-depth", type=float, default=6.0)
    p.add_argument("--file")
    p.add_argument("--out")
    p.add_argument("--frames", type=int, default=10**6)
    return p.parse_args()


A = arguments()


class Recording:
    def __init__(self, folder):
        names = sorted(glob.glob(folder + "/frame-*.depth.png"))[: A.frames]
        self.depth = [np.array(Image.open(n)) for n in names]
        for d in self.depth:
            d[d == 65535] = 0
        colours = [n.replace(".depth.png", ".color.jpg") for n in names]
        self.colour = [np.array(Image.open(n).convert("RGB")) for n in colours]
        self.pose = [np.loadtxt(n.replace(".depth.png", ".pose.txt")) for n in names]
        self.k = np.loadtxt(folder + "/camera-intrinsics.txt")

    def points(self, step, every):
        out = []
        for d, m in list(zip(self.depth, self.pose))[::every]:
            v, u = np.mgrid[step // 2 : d.shape[0] : step, step // 2 : d.shape[1] : step]
            z = d[v, u] / 1000.0
            ok = (z > 0.2) & (z < A.max_depth)
            p = np.stack([(u - self.k[0, 2]) / self.k[0, 0] * z, (v - self.k[1, 2]) / self.k[1, 1] * z, z], -1)[ok]
            out.append(p @ m[:3, :3].T + m[:3, 3])
        return np.concatenate(out)


def open3d_mesh(r):
    c, t = o3d.core, o3d.t.geometry
    k = c.Tensor(r.k)
    grid = t.VoxelBlockGrid(
        ("tsdf", "weight", "color"),
        (c.float32,) * 3,
        ((1), (1), (3)),
        voxel_size=A.voxel,
        block_resolution=16,
        block_count=20000,
    )
    for d, rgb, m in zip(r.depth, r.colour, r.pose):
        z, rgb, e = t.Image(c.Tensor(d)), t.Image(c.Tensor(rgb)), c.Tensor(np.linalg.inv(m))
        blocks = grid.compute_unique_block_coordinates(z, k, e, 1000.0, A.max_depth, 4.0)
        grid.integrate(blocks, z, rgb, k, k, e, 1000.0, A.max_depth, 4.0)
    m = grid.extract_triangle_mesh(weight_threshold=0.5)
    if A.out:
        o3d.t.io.write_triangle_mesh(A.out, m)
    return m.vertex.positions.numpy(), m.triangle.indices.numpy()


def judge(name, r, v, t):
    c = o3d.core
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        c.Tensor(np.ascontiguousarray(v, dtype=np.float32)), c.Tensor(np.ascontiguousarray(t, dtype=np.uint32))
    )
    near = scene.compute_distance(c.Tensor(r.points(7, 4).astype(np.float32))).numpy() < 0.010
    a, b, d = (v[t[:, k]].astype(float) for k in range(3))
    area = np.linalg.norm(np.cross(b - a, d - a), axis=1) / 2
    tree = c.nns.NearestNeighborSearch(c.Tensor(r.points(2, 1).astype(np.float32)))
    tree.hybrid_index(0.02)
    _, _, count = tree.hybrid_search(c.Tensor(((a + b + d) / 3).astype(np.float32)), 0.02, 1)
    alone = count.numpy().ravel() == 0
    figures = dict(
        near_10mm=round(float(near.mean()), 4),
        area_m2=round(float(area.sum()), 3),
        unsupported_area=round(float(area[alone].sum() / area.sum()), 4),
        triangles=len(t),
    )
    print(json.dumps(dict(mesh=name, voxel_m=A.voxel, frames=len(r.depth), **figures)), flush=True)


def main():
    r = Recording(A.sequence)
    if A.file:
        m = o3d.io.read_triangle_mesh(A.file)
        judge(A.file, r, np.asarray(m.vertices), np.asarray(m.triangles))
    judge("Open3D " + o3d.__version__, r, *open3d_mesh(r))


main()
