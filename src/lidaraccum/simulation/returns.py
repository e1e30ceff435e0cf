"""What the sensor makes of its hits: pulses lost, noise, mixed edges, rain, fog, zeros."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidaraccum.simulation.scan import Encounter
from lidaraccum.simulation.sensor import Sensor
from lidaraccum.simulation.surfaces import LOSS_SHARE, ROUGHNESS_M, WETTABLE

Float = NDArray[np.float32]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class Weather:
    """What hangs in the air.

    Attributes:
        name: clear, rain, fog or snow.
        clutter_per_m: Chance of an echo from the air for each metre of flight.
        near_share: Share of the pulses that a haze right before the sensor sends back.
        reach_m: How far the clutter is seen at all.
        fading_per_m: Loss of signal, per metre each way.
        wet: Share of the light that wet ground throws back less than dry ground.
    """

    name: str = "clear"
    clutter_per_m: float = 0.0
    near_share: float = 0.0
    reach_m: float = 30.0
    fading_per_m: float = 0.0
    wet: float = 0.0


def draw_weather(name: str, rng: np.random.Generator) -> Weather:
    """Weather of a name, as thick as drawn."""
    thick, wet = float(rng.uniform(0.15, 1.0)), float(1 - 10 ** -rng.uniform(0.0, 3.5))
    if name == "rain":
        return Weather(name, 0.0015 * thick, 0.004 * thick, 25.0, 0.003 * thick, 0.5 + 0.5 * wet)
    if name == "snow":
        return Weather(name, 0.006 * thick, 0.01 * thick, 18.0, 0.004 * thick, 0.3 * wet)
    if name == "fog":
        return Weather(name, 0.003 * thick, 0.1 * thick**2, 20.0, 0.07 * thick, wet)
    return Weather()


@dataclass(frozen=True)
class Realism:
    """How far the sensor is from an ideal one.

    Attributes:
        noise: Range noise, beam bias, roughness and jitter, as shares of the sensor's own.
        drop: Share of good pulses that are lost for no reason.
        faint: Whether weak echoes (dark, slanting, far) are lost.
        mixed: Share of the pulses at an edge that fall between near and far.
        weather: What hangs in the air.
    """

    noise: float = 1.0
    drop: float = 0.01
    faint: bool = True
    mixed: float = 0.08
    weather: Weather = Weather()


IDEAL = Realism(noise=0.0, drop=0.0, faint=False, mixed=0.0)
"""A sensor that measures exactly and loses nothing."""


@dataclass(frozen=True, eq=False)
class Echoes:
    """What came back, for every beam of every column (C, B).

    Attributes:
        distance: Float32 metres, inf where nothing came back.
        intensity: Float32, 0..1.
        clutter: Whether the echo is one of the air.
        mixed: Whether it lies between two surfaces, on neither.
    """

    distance: Float
    intensity: Float
    clutter: Bool
    mixed: Bool


def measure(
    met: Encounter, sensor: Sensor, realism: Realism, bias: Float, rng: np.random.Generator
) -> Echoes:
    """Turn what the rays met into what the sensor reports.

    Args:
        met: Exact distances and surfaces, (C, B).
        sensor: Its reach and noise.
        realism: What to apply.
        bias: (B,) metres each beam is always off by.
        rng: The frame's own.
    """
    distance, surface, slant = met.distance, met.surface, met.slant
    hit = np.isfinite(distance)
    safe = np.where(hit, distance, np.float32(1.0))
    signal = _signal(safe, met, sensor, realism)
    lost = ~hit | (distance > sensor.max_range_m) | (distance < sensor.min_range_m)
    if realism.faint:
        lost |= rng.random(distance.shape, dtype=np.float32) * (signal**2 + 0.06) > signal**2 * 1.1
        glare = LOSS_SHARE.take(surface)
        shiny = glare > 0
        lost[shiny] |= rng.random(int(shiny.sum()), dtype=np.float32) < glare[shiny]
    if realism.drop > 0:
        lost |= rng.random(distance.shape, dtype=np.float32) < realism.drop
    measured = safe
    if realism.noise > 0:
        rough = ROUGHNESS_M.take(surface) / np.maximum(slant, np.float32(0.3))
        sigma = np.sqrt(np.float32(sensor.range_noise_m) ** 2 + rough**2) * np.float32(
            realism.noise
        )
        measured = safe + sigma * rng.standard_normal(distance.shape, dtype=np.float32)
        measured += bias * np.float32(realism.noise)
    mixed = np.zeros(distance.shape, dtype=np.bool_)
    if realism.mixed > 0:
        measured, mixed = _mix_edges(measured, ~lost, realism.mixed, rng)
    clutter = np.zeros(distance.shape, dtype=np.bool_)
    if realism.weather.clutter_per_m > 0:
        measured, clutter = _cloud(np.where(lost, np.inf, measured), realism.weather, sensor, rng)
        lost &= ~clutter
    intensity = np.clip(met.reflectivity * slant * np.where(clutter, 0.2, 1.0), 0.0, 1.0)
    measured = np.where(lost, np.float32(np.inf), np.maximum(measured, 0.05)).astype(np.float32)
    return Echoes(measured, intensity.astype(np.float32), clutter, mixed & ~lost & ~clutter)


def _signal(distance: Float, met: Encounter, sensor: Sensor, realism: Realism) -> Float:
    """Strength of an echo; 1 for a 10 % target straight ahead at the sensor's reach.

    Asphalt and the like throw light back at a slant better than Lambert's law has it: with its
    cosine the simulated ground ended at 30 m, that of recordings at 60 to 70 m; hence the root.
    """
    strength = met.reflectivity * np.float32(10.0)
    strength *= np.sqrt(np.maximum(met.slant, np.float32(0.003)))
    if realism.weather.wet > 0:
        strength[WETTABLE[met.surface]] *= np.float32(1 - realism.weather.wet)
    strength *= (np.float32(sensor.range_m) / np.maximum(distance, np.float32(1.0))) ** 2
    if realism.weather.fading_per_m > 0:
        strength *= np.exp(np.float32(-2 * realism.weather.fading_per_m) * distance)
    return strength.astype(np.float32)


def _mix_edges(
    distance: Float, valid: Bool, share: float, rng: np.random.Generator
) -> tuple[Float, Bool]:
    """Some pulses that straddle an edge come back from between the two surfaces."""
    after = np.roll(distance, -1, axis=0)
    gap = after - distance
    edge = valid & np.roll(valid, -1, axis=0) & (np.abs(gap) > 0.25) & (np.abs(gap) < 6.0)
    rows, beams = np.nonzero(edge)
    picked = rng.random(len(rows)) < share
    rows, beams = rows[picked], beams[picked]
    mixed = np.zeros(distance.shape, dtype=np.bool_)
    out = distance.copy()
    out[rows, beams] += gap[rows, beams] * rng.uniform(0.1, 0.9, len(rows)).astype(np.float32)
    mixed[rows, beams] = True
    return out, mixed


def _cloud(
    distance: Float, weather: Weather, sensor: Sensor, rng: np.random.Generator
) -> tuple[Float, Bool]:
    """Echoes of drops and haze before anything solid."""
    air = rng.exponential(1.0 / weather.clutter_per_m, distance.shape).astype(np.float32)
    seen = (air < distance) & (air > sensor.min_range_m)
    seen &= rng.random(distance.shape, dtype=np.float32) > air / weather.reach_m
    haze = rng.random(distance.shape, dtype=np.float32) < weather.near_share
    near = sensor.min_range_m + rng.exponential(0.7, distance.shape).astype(np.float32)
    haze &= near < distance
    out = np.where(seen, air, distance)
    out = np.where(haze, near, out)
    return out.astype(np.float32), seen | haze


def draw_bias(sensor: Sensor, rng: np.random.Generator) -> Float:
    """(B,) metres each beam of this very sensor is off by."""
    return (sensor.beam_bias_m * rng.standard_normal(sensor.beams)).astype(np.float32)
