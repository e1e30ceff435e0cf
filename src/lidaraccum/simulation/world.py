"""A whole standing world: ground, streets, what spans them and what is parked, as one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.beside import crowd
from lidaraccum.simulation.catalogue import Catalogue
from lidaraccum.simulation.furniture import CAR_SIZED, KERB_SIDE
from lidaraccum.simulation.mesh import Mesh, merge
from lidaraccum.simulation.overhead import build_overhead
from lidaraccum.simulation.plot import Plot, Still
from lidaraccum.simulation.roads import Network
from lidaraccum.simulation.site import Site
from lidaraccum.simulation.streets import line_road
from lidaraccum.simulation.suburbs import overgrow
from lidaraccum.simulation.terrain import Terrain, ground_mesh, kerb_mesh, shape_terrain
from lidaraccum.simulation.thicket import Thickets
from lidaraccum.simulation.vegetation import draw_tree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Filling:
    """What fills a world, as `settings.DriveSettings` has it, where it says what each means."""

    rare: float = 1.0
    green: float = 1.0
    dense: float = 0.0
    beside: float = 0.0
    furniture: bool = True


USUAL = Filling()


@dataclass(frozen=True, eq=False)
class World:
    """What stands still.

    Attributes:
        network: Its roads.
        terrain: Its ground.
        mesh: All of it in world coordinates, metres.
        instance: (F,) int32 a triangle: the id of a parked thing, 0 for background.
        stills: What is parked, ids from 1 upwards.
        discs: (D, 3) x, y, radius in metres of what is taken.
        catalogue: The movable shapes of this world, for who drives in it.
    """

    network: Network
    terrain: Terrain
    mesh: Mesh
    instance: NDArray[np.int32]
    stills: tuple[Still, ...]
    discs: Array
    catalogue: Catalogue


def build_world(
    network: Network,
    reach_m: float,
    rng: np.random.Generator,
    filling: Filling = USUAL,
) -> World:
    """The world about the ego's way.

    Args:
        network: Its roads.
        reach_m: How far the ego will drive, metres.
        rng: What is drawn comes from here.
        filling: What of which there is more or less than usual.
    """
    furniture = filling.furniture
    growing, thickening, crowding = rng.spawn(3)
    along = network.ego_start + np.linspace(0, max(reach_m, 1.0), 12)
    terrain = shape_terrain(network, network.ego.at(along)[0], rng)
    plot = Plot(network, terrain, rng, Thickets(filling.dense, thickening))
    catalogue = Catalogue(rng, filling.rare)
    build_overhead(plot, network.kind, network.ego_start)
    site = Site(plot, catalogue, furniture=furniture)
    _fill_squares(plot, site)
    _plant_islands(plot, site)
    lined = [one for road in network.roads for one in line_road(site, road, network.kind)]
    plot.rng = growing
    garden = Site(plot, catalogue.drawing_from(growing), furniture=furniture)
    overgrow(garden, lined, network.ego.at(along)[0], filling.green)
    plot.rng = crowding
    verge = Site(plot, catalogue.drawing_from(crowding), furniture=furniture)
    stretch = (network.ego_start, network.ego_start + reach_m)
    crowd(verge, network.ego, stretch, filling.beside)
    ground = [ground_mesh(terrain, network, rng), kerb_mesh(terrain, network, rng)]
    background = merge([*ground, *plot.parts])
    parked = [still.model.mesh.posed(still.world_from_object) for still in plot.stills]
    counts = [len(background), *(len(mesh) for mesh in parked)]
    ids = np.repeat([0, *(still.id for still in plot.stills)], counts).astype(np.int32)
    mesh = merge([background, *parked])
    return World(network, terrain, mesh, ids, tuple(plot.stills), plot.discs.copy(), catalogue)


def _fill_squares(plot: Plot, site: Site) -> None:
    """Stalls, benches, trees, parked things and people standing on open squares."""
    rng = plot.rng
    for x, y, radius in plot.network.squares:
        count = int(rng.integers(15, 45))
        angle, out = rng.uniform(0, 2 * np.pi, count), radius * np.sqrt(rng.uniform(0, 1, count))
        places = np.array([x, y]) + out[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        makers = (*CAR_SIZED, *KERB_SIDE, draw_tree, draw_tree, draw_tree)
        for place in places:
            maker = makers[int(rng.integers(len(makers)))]
            site.stand(maker, place[None], rng.uniform(0, 6.28, 1), 0.8)
        chances = {"pedestrian": 8.0, "bicycle": 3, "car": 2, "van": 1, "oddity": 1.5, "pram": 1}
        for place in np.array([x, y]) + rng.uniform(-0.8, 0.8, (rng.poisson(8), 2)) * radius:
            if plot.off_road(place[None], 2.5)[0]:
                plot.park(site.catalogue.draw_any(chances), place, rng.uniform(0, 6.28))


def _plant_islands(plot: Plot, site: Site) -> None:
    """Trees, bushes and a monument in the middle of a roundabout."""
    rng = plot.rng
    for x, y, radius in plot.network.islands:
        for _ in range(int(rng.integers(0, 7))):
            angle, out = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.7) * radius
            place = np.array([x + out * np.cos(angle), y + out * np.sin(angle)])
            maker = (draw_tree, CAR_SIZED[int(rng.integers(len(CAR_SIZED)))])[int(rng.integers(2))]
            site.stand(maker, place[None], rng.uniform(0, 6.28, 1), 0.5)
