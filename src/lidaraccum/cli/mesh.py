"""`lidaraccum mesh`: an accumulated cloud in, a surface out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from lidaraccum.cli import options
from lidaraccum.cli.door import Command


@click.command(cls=Command)
@click.argument("cloud", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help="The mesh: .ply .obj .stl .off .gltf .glb.",
)
@click.option("--instance", type=int, metavar="K", help="Only the points of this object.")
@click.option("--static-only", "--drop-dynamic", is_flag=True, help="Only what does not move.")
@click.option("--depth", type=int, default=10, help="Octree depth of the Poisson solver.")
@click.option(
    "--normal-radius", type=float, default=0.5, metavar="M", help="Neighbourhood for normals."
)
@click.option(
    "--trim",
    type=float,
    default=15.0,
    metavar="PERCENT",
    help="Remove vertices below this density percentile.",
)
@click.option(
    "--voxel",
    type=float,
    default=0.0,
    metavar="M",
    help="Thin to one point a voxel first; 0 keeps all.",
)
@click.option(
    "--tile",
    type=float,
    metavar="M",
    help="Edge of a tile; 0 for one piece. Default: tiles where the cloud is large.",
)
@options.output_options
@options.talk_options
def mesh(**params: Any) -> None:
    """Make a Poisson mesh of a CLOUD that accumulate wrote.

    The poses and objects beside the cloud say from where each point was seen, so that the surface
    faces the sensor.
    """
    from lidaraccum.pipeline.mesh_files import MeshJob, mesh_file
    from lidaraccum.pipeline.meshing import MeshSettings

    job = MeshJob(
        cloud=params["cloud"],
        output=params["output"],
        instance=params["instance"],
        static_only=params["static_only"],
        overwrite=params["overwrite"],
        tile_m=params["tile"],
        settings=MeshSettings(
            depth=params["depth"],
            normal_radius_m=params["normal_radius"],
            trim_percentile=params["trim"],
            voxel_m=params["voxel"],
        ),
    )
    job.check()
    if params["dry_run"]:
        click.echo(f"would read {job.cloud}\nwould write {job.output}")
        return
    made = mesh_file(job)
    if params["as_json"]:
        click.echo(json.dumps({"vertices": len(made.vertices), "triangles": len(made.triangles)}))
    if not params["quiet"]:
        click.echo(
            f"{len(made.vertices):,} vertices, {len(made.triangles):,} triangles in {job.output}",
            err=True,
        )
