"""Registration side by side in one run: the pose error that each ICP leaves, and its time.

    python benchmarks/icp.py [points]

A bracket with 0.02 mm noise, 10 % foreign points and a local defect (a bump of 0.3 mm, 8 mm wide, is the case of the
project's own bar; one of 1 mm and 16 mm shows what least squares makes of a larger one). Every method starts two
degrees and a millimetre off. The error is the largest motion of a CAD node along its normal, the true pose known.
The other libraries register to 500,000 points sampled from the CAD with its normals; inspect3d to its surface.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.deviate.deviate import Deviate
from inspect3d.measure import Cloud
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.pose import Pose
from inspect3d.register.register import Register
from inspect3d.register.symmetry import surface_points
from inspect3d.system import import_open3d
from inspect3d.virtual.bracket import bracket
from inspect3d.virtual.deviation_field import Bump
from inspect3d.virtual.uniform_scan import uniform_scan

Method = Callable[[np.ndarray], Pose]


def main(count: int) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        part = bracket()
        part.write_step(Path(folder) / "part.step")
        nominal = load_nominal(Path(folder) / "part.step", element_size=2.0)
    surface = part.surface()
    methods = {"inspect3d, any pose": blind(nominal), "inspect3d, from start": near(nominal), **others(nominal)}
    print(f"{'defect':>16}  {'method':28} {'error':>10} {'seconds':>8}")
    for height, width in ((0.0, 8.0), (0.3, 8.0), (1.0, 16.0)):
        field = Bump((40.0, 50.0, 12.0), height, width)
        scan = uniform_scan(surface, field, count / surface.area, 0.02, 1)
        random = np.random.default_rng(12345)
        points = scan.points_cad.copy()
        foreign = random.permutation(len(points))[: len(points) // 10]
        low, high = nominal.surface.bounds
        points[foreign] = random.uniform(low - 10, high + 10, (len(foreign), 3))
        start = Pose(Rotation.from_rotvec(np.radians([1.2, -1.0, 1.2])).as_matrix(), np.array([0.6, -0.5, 0.6]))
        for name, method in methods.items():
            method(start(points[:2000]))
            begun = perf_counter()
            found = method(start(points)) @ start
            seconds = perf_counter() - begun
            nodes = nominal.mesh.nodes
            error = np.abs(np.einsum("ni,ni->n", found(nodes) - nodes, nominal.mesh.normals)).max()
            print(f"{height:4.1f} mm x {width:4.0f} mm  {name:28} {1e3 * error:7.1f} um {seconds:8.2f}", flush=True)


def blind(nominal: Nominal) -> Method:
    """Return inspect3d's registration without a start."""
    return lambda points: deviated(nominal, Register(nominal), points)


def near(nominal: Nominal) -> Method:
    """Return inspect3d's registration from the given start."""
    return lambda points: deviated(nominal, Register(nominal, start=Pose.identity()), points)


def deviated(nominal: Nominal, register: Register, points: np.ndarray) -> Pose:
    """Return the final pose, the common alignment of the map included."""
    cloud = Cloud("scan", points)
    if len(points) < 5000:
        return register(cloud).cad_from_measured
    found = Deviate()((cloud,), (register(cloud),), nominal, np.ones(len(nominal.mesh), bool))
    return found.alignments[0].cad_from_measured


def others(nominal: Nominal) -> dict[str, Method]:
    """Return the registrations of other libraries that are installed."""
    import small_gicp
    import trimesh

    open3d = import_open3d()
    registration = open3d.pipelines.registration
    places, normals = surface_points(nominal.surface, 500_000)
    target = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(places))
    target.normals = open3d.utility.Vector3dVector(normals)
    enough = registration.ICPConvergenceCriteria(1e-9, 1e-9, 60)

    def by_open3d(kernel: object | None) -> Method:
        arguments = () if kernel is None else (kernel,)
        estimator = registration.TransformationEstimationPointToPlane(*arguments)

        def method(points: np.ndarray) -> Pose:
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
            found = registration.registration_icp(cloud, target, 3.0, np.eye(4), estimator, enough)
            return Pose.from_matrix(found.transformation)

        return method

    def by_small_gicp(points: np.ndarray) -> Pose:
        found = small_gicp.align(
            places, points, registration_type="GICP", downsampling_resolution=0.5, max_correspondence_distance=3.0,
            num_threads=2,
        )  # fmt: skip
        return Pose.from_matrix(found.T_target_source)

    def by_trimesh(points: np.ndarray) -> Pose:
        matrix, _, _ = trimesh.registration.icp(points[:20_000], places[:100_000], reflection=False, scale=False)
        return Pose.from_matrix(matrix)

    return {
        "Open3D point-to-plane": by_open3d(None),
        "Open3D point-to-plane, Tukey": by_open3d(registration.TukeyLoss(0.5)),
        "small_gicp GICP": by_small_gicp,
        "trimesh ICP (20,000 points)": by_trimesh,
    }


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
