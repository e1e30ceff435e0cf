"""A cloud file in, a mesh file out: which points, seen from where, in how many tiles."""

from __future__ import annotations

import json
import logging
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.accumulation import MOVING
from lidaraccum.errors import InputError, SettingsError
from lidaraccum.io.atomic import check_free, put_in_place, writable
from lidaraccum.io.clouds import Cloud, read_cloud
from lidaraccum.io.poses import read_poses
from lidaraccum.pipeline.meshing import Mesh, MeshSettings, reconstruct, write_mesh

log = logging.getLogger(__name__)

SUFFIXES = (".ply", ".obj", ".stl", ".off", ".gltf", ".glb")

ONE_PIECE_POINTS = 3_000_000
"""A cloud of up to so many points is meshed in one piece unless told otherwise."""

FARTHEST_SENSOR_M = 5_000.0
"""Poses whose middle is farther than this from the cloud's middle are not the sensor's places."""

DEFAULT_TILE_M = 60.0
"""Edge of a tile where the cloud is larger: depth 10 then resolves 6 cm."""


@dataclass(frozen=True)
class MeshJob:
    """One mesh to make.

    Attributes:
        cloud: What accumulate wrote.
        output: The mesh to write.
        instance: Only this object's points; None for all.
        static_only: Leave out what moves.
        overwrite: Replace an existing mesh.
        tile_m: Edge of a tile, metres; 0 for one piece; None decides by the cloud's size.
        settings: How the surface is made.
    """

    cloud: Path
    output: Path
    instance: int | None = None
    static_only: bool = False
    overwrite: bool = False
    tile_m: float | None = None
    settings: MeshSettings = field(default_factory=MeshSettings)

    def check(self) -> None:
        """Refuse what cannot be written before anything is read.

        Raises:
            SettingsError: No mesh format has this suffix.
            OutputExistsError: The mesh exists.
        """
        if self.output.suffix.lower() not in SUFFIXES:
            raise SettingsError(
                f"no mesh format is called {self.output.suffix or self.output.name!r}",
                hint=f"one of {' '.join(SUFFIXES)}",
            )
        check_free(self.output, self.overwrite)


def mesh_file(job: MeshJob) -> Mesh:
    """Read the cloud, make the surface, write it.

    Raises:
        InputError: The cloud cannot be read, or has too few of the wanted points.
    """
    job.check()
    cloud = read_cloud(job.cloud)
    keep = np.ones(len(cloud), dtype=np.bool_)
    if job.static_only:
        keep &= cloud.label != MOVING
    if job.instance is not None:
        keep &= cloud.instance == job.instance
        if not keep.any():
            raise InputError(f"{job.cloud} has no points of instance {job.instance}")
    tile_m = job.tile_m
    if tile_m is None:
        tile_m = DEFAULT_TILE_M if np.count_nonzero(keep) > ONE_PIECE_POINTS else 0.0
    seen_from = viewpoints(job.cloud, cloud)
    made = reconstruct(cloud.positions[keep], seen_from[keep], replace(job.settings, tile_m=tile_m))
    # Open3D goes by the suffix, so the unfinished mesh has its final name in a folder of its own.
    with (
        writable(job.output),
        tempfile.TemporaryDirectory(dir=job.output.parent, prefix=".mesh-") as folder,
    ):
        unfinished = Path(folder) / job.output.name
        write_mesh(unfinished, made)
        put_in_place(unfinished, job.output)
    return made


def viewpoints(path: Path, cloud: Cloud) -> NDArray[np.float64]:
    """Where the sensor was for each point (N, 3), in the cloud's coordinates.

    For a mover that is where the sensor was as seen from the mover. Where the poses beside the
    cloud do not say (none there, or of frames that were georeferenced, whose files do not hold the
    sensor's place) every point is taken to be seen from above.
    """
    middle = np.median(cloud.positions, axis=0)
    above = np.tile(middle + np.array([0.0, 0.0, 1000.0]), (len(cloud.positions), 1))
    poses_path = path.with_suffix(".poses.txt")
    if not poses_path.exists():
        log.warning("%s is not there: normals are turned upwards instead", poses_path)
        return above
    poses = read_poses(poses_path).world_from_sensor
    if cloud.frame.max() >= len(poses):
        raise InputError(f"{poses_path} has {len(poses)} poses, the cloud has more frames")
    if np.linalg.norm(np.median(poses[:, :3, 3], axis=0) - middle) > FARTHEST_SENSOR_M:
        log.warning("the poses lie far from the cloud: normals are turned upwards instead")
        return above
    seen_from: NDArray[np.float64] = poses[cloud.frame, :3, 3]
    objects_path = path.with_suffix(".objects.json")
    if objects_path.exists():
        for entry in json.loads(objects_path.read_text())["objects"]:
            own = np.flatnonzero(cloud.instance == entry["instance"])
            for frame, rows in entry["reference_from_frame"].items():
                mine = own[cloud.frame[own] == int(frame)]
                seen_from[mine] = np.reshape(rows, (4, 4))[:3, 3]
    return seen_from
