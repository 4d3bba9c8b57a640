#!/usr/bin/env python3
"""Open3D as the peer of tsdf-hash on streams made by synth_rgbd.py, and the evaluation of any mesh or trajectory on them.
Prints one JSON line per figure.  Needs numpy and open3d (pip install open3d==0.19.0; 0.20.0 for everything but `legacy`).

    python3 synth_rgbd.py loop --preset loop
    python3 mapping_peers.py fuse loop --peer vbg --voxel 0.01                  integrate + ray cast + mesh, time and accuracy
    python3 mapping_peers.py fuse loop --peer vbg --voxel 0.01 --pixel-shift 0.5   its half-pixel bias removed: quote this row too
    python3 mapping_peers.py odometry arc                                        frame-to-frame tracking, three methods
    python3 mapping_peers.py slam arc --voxel 0.02                               frame-to-model loop
    python3 mapping_peers.py relocalise loop                                     FPFH + fast global registration + ICP
    python3 mapping_peers.py mesh loop --file ours.ply [--frames N]              accuracy and completeness of a mesh (world frame)
    python3 mapping_peers.py trajectory arc --file ours.txt                      ATE and RPE of a TUM file, first poses made equal

Times are CPU time of the process over all threads (cpu_ms, median per frame); wall_ms is beside it. On a shared machine quote ratios of
cpu_ms measured in turn (A B A B). --threads pins the process to that many cores.
Metrics (mm): err_* = |sdf(vertex)| over all vertices against the analytic scene. compl_* = distance from analytic surface points seen by
the cameras (every 19th pixel of every used frame) to the mesh; compl_5mm = share within 5 mm. ray_* = rendered depth against the ANALYTIC depth,
never the noisy input; ray_fill = share of all pixels that got a depth. Vertices of a triangle soup count once per triangle: weld before comparing.
"""

import argparse
import json
import math
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))


def args():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("what", choices=["fuse", "odometry", "slam", "relocalise", "mesh", "trajectory"])
    p.add_argument("stream")
    p.add_argument(
        "--peer",
        choices=["vbg", "legacy", "uniform"],
        default="vbg",
        help="VoxelBlockGrid, ScalableTSDFVolume, UniformTSDFVolume",
    )
    p.add_argument("--voxel", type=float, default=0.01)
    p.add_argument("--trunc", type=float, default=4.0, help="truncation, in voxels")
    p.add_argument("--frames", type=int, default=10**6)
    p.add_argument("--every", type=int, default=4, help="ray cast / query every n-th frame")
    p.add_argument("--threads", type=int, default=1)
    p.add_argument("--pixel-shift", type=float, default=0.0)
    p.add_argument("--no-colour", action="store_true")
    p.add_argument("--blocks", type=int, default=0, help="VoxelBlockGrid's first allocation (0: from the voxel size)")
    p.add_argument("--file")
    p.add_argument("--out", help="write the peer's mesh (PLY)")
    return p.parse_args()


A = args()
os.environ["OMP_NUM_THREADS"] = str(A.threads)
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, set(sorted(os.sched_getaffinity(0))[: A.threads]))
import numpy as np
import open3d as o3d

import synth_rgbd as g

o3c = o3d.core
o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)


def emit(**k):
    print(
        json.dumps({a: (round(float(b), 4) if isinstance(b, (float, np.floating)) else b) for a, b in k.items()}),
        flush=True,
    )


class Clock:
    def __init__(self):
        self.w, self.k = [], []

    def __enter__(self):
        self.t = time.perf_counter(), time.process_time()

    def __exit__(self, *_):
        self.w.append(time.perf_counter() - self.t[0])
        self.k.append(time.process_time() - self.t[1])

    def out(self, name):
        return {name + "_cpu_ms": float(np.median(self.k)) * 1e3, name + "_wall_ms": float(np.median(self.w)) * 1e3}


def matrix(x, y, z, a, b, c, w):
    n = math.sqrt(a * a + b * b + c * c + w * w)
    a, b, c, w = a / n, b / n, c / n, w / n
    return np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - c * w), 2 * (a * c + b * w), x],
            [2 * (a * b + c * w), 1 - 2 * (a * a + c * c), 2 * (b * c - a * w), y],
            [2 * (a * c - b * w), 2 * (b * c + a * w), 1 - 2 * (a * a + b * b), z],
            [0, 0, 0, 1.0],
        ]
    )


def tum(path):
    rows = np.loadtxt(path, ndmin=2)
    return rows[:, 0], [matrix(*r[1:8]) for r in rows]


def peak_mb():
    try:
        return next(int(l.split()[1]) / 1024 for l in open("/proc/self/status") if l.startswith("VmHWM"))
    except OSError:
        return float("nan")


class Stream:
    def __init__(self, d, images=True):
        _, T = tum(d + "/groundtruth.txt")
        n = min(A.frames, len(T))
        self.T, self.n = T[:n], n
        f = [float(x) for x in open(d + "/intrinsics.txt").read().split()]
        self.scale = f[6]
        self.K = np.array([[f[2], 0, f[4]], [0, f[3], f[5]], [0, 0, 1.0]]) + np.array(
            [[0, 0, A.pixel_shift], [0, 0, A.pixel_shift], [0, 0, 0]]
        )
        w = d + "/world.txt"
        self.world = g.offset_matrix(*np.loadtxt(w)) if os.path.exists(w) else np.eye(4)  # world_from_scene
        self.scene = [np.linalg.inv(self.world) @ M for M in self.T]  # scene_from_camera
        if not images:
            return
        self.D = [np.asarray(o3d.io.read_image(f"{d}/depth/{i:04d}.png")) for i in range(n)]
        self.C = None
        if os.path.exists(d + "/rgb/0000.png") and not A.no_colour:
            self.C = [
                np.ascontiguousarray(np.asarray(o3d.io.read_image(f"{d}/rgb/{i:04d}.png"))[:, :, :3]) for i in range(n)
            ]

    def truth(self, i):
        """analytic depth image (m)"""
        M = self.scene[i]
        return g.cast(M[:3, 3], g.rays(M[:3, :3]))[0].reshape(g.H, g.W)


def evaluate(s, v, tri):
    Wi = np.linalg.inv(s.world)
    r = {}
    if len(v):
        e = np.abs(g.sdf(np.asarray(v, float) @ Wi[:3, :3].T + Wi[:3, 3])) * 1e3
        r = dict(
            err_mean_mm=e.mean(),
            err_std_mm=e.std(),
            err_p50_mm=np.median(e),
            err_p95_mm=np.percentile(e, 95),
            err_max_mm=e.max(),
        )
    if len(v) and len(tri):
        u, w = np.meshgrid(np.arange(5, 640, 19), np.arange(5, 480, 19))
        ray = np.stack([(u - g.CX) / g.FX, (w - g.CY) / g.FY, np.ones(u.shape)], -1).reshape(-1, 3)
        pts = []
        for M in s.scene:
            d = ray @ M[:3, :3].T
            t, _ = g.cast(M[:3, 3], d)
            pts.append((M[:3, 3] + t[:, None] * d) @ s.world[:3, :3].T + s.world[:3, 3])
        sc = o3d.t.geometry.RaycastingScene()
        sc.add_triangles(
            o3c.Tensor(np.ascontiguousarray(v, dtype=np.float32)),
            o3c.Tensor(np.ascontiguousarray(tri, dtype=np.uint32)),
        )
        q = sc.compute_distance(o3c.Tensor(np.concatenate(pts).astype(np.float32))).numpy() * 1e3
        r.update(
            compl_mean_mm=float(q.mean()),
            compl_5mm=float((q < 5).mean()),
            compl_10mm=float((q < 10).mean()),
            compl_20mm=float((q < 20).mean()),
        )
        t3 = np.asarray(tri)
        e2 = np.sort(np.concatenate([t3[:, [0, 1]], t3[:, [1, 2]], t3[:, [2, 0]]]), 1).astype(np.int64)
        _, cnt = np.unique(e2[:, 0] * (int(t3.max()) + 1) + e2[:, 1], return_counts=True)
        P = np.asarray(v, float)
        area = np.linalg.norm(np.cross(P[t3[:, 1]] - P[t3[:, 0]], P[t3[:, 2]] - P[t3[:, 0]]), axis=1) / 2
        r.update(
            edges_boundary=int((cnt == 1).sum()),
            edges_nonmanifold=int((cnt > 2).sum()),
            tris_degenerate=int((area < 1e-10).sum()),
        )
    return r


def fuse(s):
    base = dict(
        figure="fuse",
        peer=f"open3d_{o3d.__version__}_{A.peer}",
        voxel_m=A.voxel,
        trunc_voxels=A.trunc,
        threads=A.threads,
        stream=os.path.basename(os.path.normpath(A.stream)),
        pixel_shift=A.pixel_shift,
        colour=s.C is not None,
        frames=s.n,
    )
    E = [np.linalg.inv(T) for T in s.T]
    I, M, extra = Clock(), Clock(), {}
    if A.peer == "vbg":
        f32 = o3c.float32
        K = o3c.Tensor(s.K)
        te = [o3c.Tensor(e) for e in E]
        tr = A.trunc
        nb = A.blocks or {0.02: 2000, 0.01: 8000, 0.005: 40000}.get(A.voxel, 20000)
        names, kinds, sizes = (
            (("tsdf", "weight", "color"), (f32,) * 3, ((1), (1), (3)))
            if s.C is not None
            else (("tsdf", "weight"), (f32,) * 2, ((1), (1)))
        )
        vbg = o3d.t.geometry.VoxelBlockGrid(
            names, kinds, sizes, voxel_size=A.voxel, block_resolution=16, block_count=nb, device=o3c.Device("CPU:0")
        )
        td = [o3d.t.geometry.Image(o3c.Tensor(d)) for d in s.D]
        tc = [o3d.t.geometry.Image(o3c.Tensor(c)) for c in s.C] if s.C is not None else None
        for i in range(s.n):
            with I:
                b = vbg.compute_unique_block_coordinates(td[i], K, te[i], s.scale, 20.0, tr)
                if tc:
                    vbg.integrate(b, td[i], tc[i], K, K, te[i], s.scale, 20.0, tr)
                else:
                    vbg.integrate(b, td[i], K, te[i], s.scale, 20.0, tr)
        rss = peak_mb()
        with M:
            m = vbg.extract_triangle_mesh(weight_threshold=0.5)
        v, tri = m.vertex.positions.numpy(), m.triangle.indices.numpy()
        R, re = Clock(), []
        for i in range(0, s.n, A.every):
            b = vbg.compute_unique_block_coordinates(td[i], K, te[i], s.scale, 20.0, tr)
            with R:
                r = vbg.ray_cast(
                    b,
                    K,
                    te[i],
                    640,
                    480,
                    ["depth", "normal"] + (["color"] if tc else []),
                    s.scale,
                    0.1,
                    20.0,
                    0.5,
                    tr,
                    8,
                )
            z = r["depth"].numpy()[..., 0] / s.scale
            ok = z > 0
            e = np.abs(z - s.truth(i))[ok] * 1e3
            re.append((e.mean(), np.median(e), ok.mean()))
        nb = int(vbg.hashmap().size())
        extra = dict(
            **R.out("raycast"),
            ray_err_mean_mm=float(np.mean([a for a, _, _ in re])),
            ray_err_p50_mm=float(np.mean([a for _, a, _ in re])),
            ray_fill=float(np.mean([a for _, _, a in re])),
            blocks=nb,
            map_mib=nb * 4096 * (20 if tc else 8) / 2**20,
        )
    else:
        P = o3d.pipelines.integration
        ct = P.TSDFVolumeColorType.RGB8 if s.C is not None else P.TSDFVolumeColorType.NoColor
        if A.peer == "legacy":
            vol = P.ScalableTSDFVolume(voxel_length=A.voxel, sdf_trunc=A.trunc * A.voxel, color_type=ct)
        else:
            vol = P.UniformTSDFVolume(
                length=6.4,
                resolution=int(round(6.4 / A.voxel)),
                sdf_trunc=A.trunc * A.voxel,
                color_type=ct,
                origin=np.array([[-3.2], [-3.2], [-0.4]]),
            )
        K = o3d.camera.PinholeCameraIntrinsic(640, 480, s.K[0, 0], s.K[1, 1], s.K[0, 2], s.K[1, 2])
        blank = np.zeros((480, 640, 3), np.uint8)
        R = [
            o3d.geometry.RGBDImage.create_from_color_and_depth(
                o3d.geometry.Image(s.C[i] if s.C else blank), o3d.geometry.Image(s.D[i]), s.scale, 20.0, False
            )
            for i in range(s.n)
        ]
        for i in range(s.n):
            with I:
                vol.integrate(R[i], K, E[i])
        rss = peak_mb()
        with M:
            m = vol.extract_triangle_mesh()
        v, tri = np.asarray(m.vertices), np.asarray(m.triangles)
        if len(v) == 0:
            extra = dict(warning="no vertices: known for ScalableTSDFVolume in the 0.20.0 wheel, use 0.19.0")
    if A.out:
        o3d.io.write_triangle_mesh(
            A.out,
            o3d.geometry.TriangleMesh(
                o3d.utility.Vector3dVector(np.asarray(v, float)), o3d.utility.Vector3iVector(tri)
            ),
        )
    emit(
        **base,
        **I.out("integrate"),
        **M.out("mesh"),
        peak_rss_mib=rss,
        verts=len(v),
        tris=len(tri),
        **extra,
        **evaluate(s, v, tri),
    )


def trajectory_error(P, T):
    e = np.array([np.linalg.norm(p[:3, 3] - t[:3, 3]) for p, t in zip(P, T)]) * 1e3
    rel = [np.linalg.inv(np.linalg.inv(T[i]) @ T[i + 1]) @ (np.linalg.inv(P[i]) @ P[i + 1]) for i in range(len(P) - 1)]
    rt = np.array([np.linalg.norm(r[:3, 3]) for r in rel]) * 1e3
    ra = np.degrees([2 * math.asin(min(1.0, np.linalg.norm(r[:3, :3] - np.eye(3)) / math.sqrt(8))) for r in rel])
    return dict(
        ate_rmse_mm=math.sqrt((e**2).mean()),
        ate_max_mm=e.max(),
        end_err_mm=e[-1],
        rpe_trans_rmse_mm=math.sqrt((rt**2).mean()) if len(rt) else 0.0,
        rpe_rot_rmse_deg=math.sqrt((ra**2).mean()) if len(ra) else 0.0,
        path_m=sum(np.linalg.norm(T[i + 1][:3, 3] - T[i][:3, 3]) for i in range(len(T) - 1)),
    )


def rgbd(s):
    if s.C is None:
        sys.exit("this needs colour images: make the stream without --no-colour")
    return [
        o3d.t.geometry.RGBDImage(o3d.t.geometry.Image(o3c.Tensor(c)), o3d.t.geometry.Image(o3c.Tensor(d)))
        for c, d in zip(s.C, s.D)
    ]


def odometry(s):
    od = o3d.t.pipelines.odometry
    R = rgbd(s)
    K = o3c.Tensor(s.K)
    it = [od.OdometryConvergenceCriteria(k) for k in (10, 5, 3)]
    for name in ("PointToPlane", "Hybrid", "Intensity"):
        P, c, lost = [s.T[0]], Clock(), 0
        for i in range(1, s.n):
            D = np.eye(4)
            with c:
                try:
                    D = od.rgbd_odometry_multi_scale(
                        R[i], R[i - 1], K, o3c.Tensor(np.eye(4)), s.scale, 20.0, it, getattr(od.Method, name)
                    ).transformation.numpy()
                except RuntimeError:
                    lost += 1
            P.append(P[-1] @ D)
        emit(
            figure="odometry",
            peer=f"open3d_{o3d.__version__}_{name}",
            stream=os.path.basename(os.path.normpath(A.stream)),
            threads=A.threads,
            frames=s.n,
            lost=lost,
            **c.out("track"),
            **trajectory_error(P, s.T),
        )


def slam(s):
    S = o3d.t.pipelines.slam
    R, K, dev = rgbd(s), o3c.Tensor(s.K), o3c.Device("CPU:0")
    m = S.Model(A.voxel, 16, A.blocks or 8000, o3c.Tensor(s.T[0]), dev)
    a, b = S.Frame(480, 640, K, dev), S.Frame(480, 640, K, dev)
    T, P, lost, ck, ci, cr = s.T[0].copy(), [], 0, Clock(), Clock(), Clock()
    for i in range(s.n):
        a.set_data_from_image("depth", R[i].depth)
        a.set_data_from_image("color", R[i].color)
        if i:
            with ck:
                try:
                    T = T @ m.track_frame_to_model(a, b, s.scale, 20.0, 0.07).transformation.numpy()
                except RuntimeError:
                    lost += 1
        m.update_frame_pose(i, o3c.Tensor(T))
        with ci:
            m.integrate(a, s.scale, 20.0, A.trunc)
        with cr:
            m.synthesize_model_frame(b, s.scale, 0.1, 20.0, A.trunc, False)
        P.append(T)
    emit(
        figure="slam",
        peer=f"open3d_{o3d.__version__}_frame_to_model",
        voxel_m=A.voxel,
        stream=os.path.basename(os.path.normpath(A.stream)),
        threads=A.threads,
        frames=s.n,
        lost=lost,
        **ck.out("track"),
        **ci.out("integrate"),
        **cr.out("raycast"),
        **trajectory_error(P, s.T),
    )


def relocalise(s):
    """Map = all frames at 2 cm; each query = one frame, downsampled to 5 cm for FPFH + FGR, then point-to-plane ICP at
    full map resolution."""
    reg = o3d.pipelines.registration
    search = o3d.geometry.KDTreeSearchParamHybrid
    K = o3d.camera.PinholeCameraIntrinsic(640, 480, s.K[0, 0], s.K[1, 1], s.K[0, 2], s.K[1, 2])
    clouds = [
        o3d.geometry.PointCloud.create_from_depth_image(o3d.geometry.Image(d), K, np.eye(4), s.scale, 20.0, 2)
        for d in s.D
    ]
    full = o3d.geometry.PointCloud()
    for c, T in zip(clouds, s.T):
        full += o3d.geometry.PointCloud(c).transform(T)
    full = full.voxel_down_sample(0.02)
    full.estimate_normals(search(0.06, 30))
    coarse = full.voxel_down_sample(0.05)
    coarse.estimate_normals(search(0.15, 30))
    f0 = reg.compute_fpfh_feature(coarse, search(0.25, 100))
    c, et, er = Clock(), [], []
    for i in range(0, s.n, A.every):
        with c:
            q = clouds[i].voxel_down_sample(0.02)
            k = q.voxel_down_sample(0.05)
            k.estimate_normals(search(0.15, 30))
            f = reg.compute_fpfh_feature(k, search(0.25, 100))
            r = reg.registration_fgr_based_on_feature_matching(
                k, coarse, f, f0, reg.FastGlobalRegistrationOption(maximum_correspondence_distance=0.05)
            )
            r = reg.registration_icp(q, full, 0.10, r.transformation, reg.TransformationEstimationPointToPlane())
            r = reg.registration_icp(q, full, 0.04, r.transformation, reg.TransformationEstimationPointToPlane())
        D = np.linalg.inv(s.T[i]) @ r.transformation
        et.append(np.linalg.norm(D[:3, 3]) * 1e3)
        er.append(math.degrees(2 * math.asin(min(1.0, np.linalg.norm(D[:3, :3] - np.eye(3)) / math.sqrt(8)))))
    et, er = np.array(et), np.array(er)
    emit(
        figure="relocalise",
        peer=f"open3d_{o3d.__version__}_fpfh_fgr_icp",
        stream=os.path.basename(os.path.normpath(A.stream)),
        threads=A.threads,
        queries=len(et),
        **c.out("query"),
        share_5mm_02deg=float(((et < 5) & (er < 0.2)).mean()),
        share_2cm_1deg=float(((et < 20) & (er < 1)).mean()),
        median_trans_mm=float(np.median(et)),
        median_rot_deg=float(np.median(er)),
    )


def main():
    if A.what in ("mesh", "trajectory") and not A.file:
        sys.exit(f"{A.what} needs --file")
    s = Stream(A.stream, A.what not in ("mesh", "trajectory"))
    if A.what == "mesh":
        m = o3d.io.read_triangle_mesh(A.file)
        v, t = np.asarray(m.vertices), np.asarray(m.triangles)
        if not len(v):
            sys.exit(f"{A.file}: no vertices")
        emit(figure="mesh", file=os.path.basename(A.file), frames=s.n, verts=len(v), tris=len(t), **evaluate(s, v, t))
    elif A.what == "trajectory":
        tg, _ = tum(A.stream + "/groundtruth.txt")
        te, P = tum(A.file)
        k = [int(np.abs(te - x).argmin()) for x in tg[: s.n]]
        if max(abs(te[j] - x) for j, x in zip(k, tg)) > 0.01:
            sys.exit("a ground-truth stamp has no estimate within 10 ms")
        P = [P[j] for j in k]
        F = s.T[0] @ np.linalg.inv(P[0])
        emit(
            figure="trajectory", file=os.path.basename(A.file), frames=s.n, **trajectory_error([F @ p for p in P], s.T)
        )
    else:
        {"fuse": fuse, "odometry": odometry, "slam": slam, "relocalise": relocalise}[A.what](s)


main()
