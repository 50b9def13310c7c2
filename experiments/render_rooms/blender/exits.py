"""Where rays leave the furniture: for each pixel the farthest side of the one model that its ray meets first."""

import bpy
import numpy as np

from experiments.render_rooms.viewpoints import panorama_rays

_SAME = 2e-3  # metres between cast and rendered distance: pixels are rendered within 0.5 % of their centre
_BEFORE = 5e-3  # metres before the rendered distance from where a ray that met something else is cast again
_FREE = 0.01  # metres that a ray starts outside a model's box


def cast_exits(panorama: dict, distance: np.ndarray) -> dict[str, np.ndarray]:
    """`exit` and `first` (h, 2 h) float32, metres along the rays through the pixels' centres of `panorama`.

    `first` is where a ray meets what the rendered `distance` (h, 2 h) shows: clear panes and leaves that Cycles looked
    through are passed; 0 outside. `exit` is where it leaves the model that it met for the last time, its panes
    included; 0 where it met no model. The room is built, and nothing in it is hidden yet."""
    bpy.context.view_layer.update()
    place, shown = np.array(panorama["place"], float), distance.ravel()
    rays = panorama_rays(len(distance), panorama["yaw"]).reshape(-1, 3)
    first, met = _shown_hits(place, rays, shown)
    leave = np.zeros(len(rays))
    for thing in (thing for thing in bpy.context.scene.objects if thing.get("model")):
        pixels = np.flatnonzero(met == thing.name)
        if len(pixels):
            leave[pixels] = np.maximum(_last_hits(thing, place, rays[pixels]), first[pixels])
    return {
        "exit": leave.reshape(distance.shape).astype(np.float32),
        "first": first.reshape(distance.shape).astype(np.float32),
    }


def _shown_hits(place: np.ndarray, rays: np.ndarray, shown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First hits, or hits just at the distance that is `shown` (n,) where these are nearer to it."""
    first, met = _first_hits(place, rays, np.zeros(len(rays)))
    first[shown == 0], met[shown == 0] = 0.0, ""
    other = np.flatnonzero(np.abs(first - shown) > _SAME)
    again, thing = _first_hits(place, rays[other], np.maximum(shown[other] - _BEFORE, 0.0))
    nearer = np.abs(again - shown[other]) < np.abs(first[other] - shown[other])
    first[other[nearer]], met[other[nearer]] = again[nearer], thing[nearer]
    return first, met


def _first_hits(place: np.ndarray, rays: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,) from `place` and name of what is met first beyond `start` (n,) metres; 0 and "" for nothing."""
    graph, cast = bpy.context.evaluated_depsgraph_get(), bpy.context.scene.ray_cast
    distance, met = np.zeros(len(rays)), np.full(len(rays), "", object)
    for number, ray in enumerate(rays):
        hit, where, _, _, thing, _ = cast(graph, place + start[number] * ray, ray)
        if hit:
            distance[number], met[number] = np.dot(np.subtract(where, place), ray), thing.name
    return distance, met


def _last_hits(thing: bpy.types.Object, place: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Farthest distance (n,) at which `rays` meet the object, cast back from beyond its box; 0 where they miss it."""
    to_world = np.array(thing.matrix_world)
    to_local = np.linalg.inv(to_world)
    corners = np.array(thing.bound_box) @ to_world[:3, :3].T + to_world[:3, 3]
    far = np.max(np.linalg.norm(corners - place, axis=1)) + _FREE
    starts = (place + far * rays) @ to_local[:3, :3].T + to_local[:3, 3]
    back = -rays @ to_local[:3, :3].T
    back /= np.linalg.norm(back, axis=1, keepdims=True)
    answers = [thing.ray_cast(start, ray) for start, ray in zip(starts, back, strict=True)]
    hit = np.array([answer[0] for answer in answers])
    world = np.array([answer[1] for answer in answers]) @ to_world[:3, :3].T + to_world[:3, 3]
    return np.where(hit, np.sum((world - place) * rays, axis=1), 0.0)
