"""Augmentation of examples: exact changes (a yaw of the room, a mirror), and changes of the picture's tone that clean
and degraded share."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_sum
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.rotations import matrix_from_quats, yaw_quat
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays
from rein3d_jax.restore.learned.loss import Example

_DARKEST = 0.8  # nepers of light, in the display's values, that hidden places may lack
_BEHIND = 0.15  # nepers of distance behind what the anchor sees, at which a place begins to be hidden; at twice it, is
_FAR_AWAY = 100.0  # metres, of what has no distance
_FAR_ONLY = 0.1  # share of the examples that have but the fill that needs no shell


def augment(key: jax.Array, example: Example) -> Example:
    """The example (t, h, w) as another room and another camera might have made it."""
    yaw, flip, tone, fill, shade = jax.random.split(key, 5)
    example = shaded(example, _DARKEST * jax.random.uniform(shade))
    columns = jax.random.randint(yaw, (), 0, example.clip.alpha.shape[-1])
    example = yawed(example, columns)
    mirror = jax.random.bernoulli(flip)
    example = jax.tree.map(lambda a, b: jnp.where(mirror, a, b), mirrored(example), example)
    return _toned(tone, _without_shell(fill, example))


def shaded(example: Example, depth: jax.Array) -> Example:
    """The example with what the anchor does not see darkened by up to exp(-depth): light comes from where the camera
    stands, and what comes back from walls hardly gets behind things, less than a tracer without bounces shows."""
    clean = example.clean_distance
    rows, columns = clean.shape[1:]
    points = example.clip.position[:, None, None] + clean[..., None] * pixel_rays(rows, columns)
    inverse = 1 / jnp.where(clean[0] > 0, clean[0], _FAR_AWAY)
    ratio = sample_sphere(inverse[..., None], *pixels_from_rays(points, rows, columns))[..., 0]
    behind = jnp.log(jnp.maximum(ratio * jnp.linalg.norm(points, axis=-1), 1e-3))
    hidden = jnp.clip((behind - _BEHIND) / _BEHIND, 0.0, 1.0) * (clean > 0)
    soft = jax.vmap(lambda x: window_sum(x[..., None], 1)[..., 0])(hidden) / 9 * (clean > 0)
    return example.replace(clean_rgb=example.clean_rgb * jnp.exp(-depth * soft)[..., None])


def yawed(example: Example, columns: jax.Array) -> Example:
    """The example after a yaw of the room to the right by `columns` pixels: pictures rolled, positions rotated."""
    pictures = _over_pictures(example, lambda x: jnp.roll(x, columns, axis=2))
    angle = columns * (2 * jnp.pi / example.clip.alpha.shape[-1])
    rotation = matrix_from_quats(yaw_quat(-angle))
    position = jnp.matmul(example.clip.position, rotation.T, precision="highest")
    return pictures.replace(clip=pictures.clip.replace(position=position))


def mirrored(example: Example) -> Example:
    """The example with left and right exchanged."""
    pictures = _over_pictures(example, lambda x: jnp.flip(x, axis=2))
    position = example.clip.position * jnp.array([1.0, -1.0, 1.0])
    return pictures.replace(clip=pictures.clip.replace(position=position))


def _over_pictures(example: Example, change) -> Example:
    return jax.tree.map(lambda x: change(x) if x.ndim > 2 else x, example)


def _without_shell(key: jax.Array, example: Example) -> Example:
    """_FAR_ONLY of the examples lose the shell: the fill from the far side stands in for the others."""
    drop, clip = jax.random.bernoulli(key, _FAR_ONLY), example.clip
    rgb = jnp.where(drop, clip.fill_rgb[..., 1:2, :], clip.fill_rgb)
    distance = jnp.where(drop, clip.fill_distance[..., 1:2], clip.fill_distance)
    return example.replace(clip=clip.replace(fill_rgb=rgb, fill_distance=distance))


def _toned(key: jax.Array, example: Example) -> Example:
    """Gamma, gain of each channel, saturation, offset, and which channel is which, drawn once and applied to all
    colours alike: a surface's colour says nothing of what it hides."""
    gamma, gain, cast, saturation, offset, order = jax.random.split(key, 6)
    power = jnp.exp(jax.random.uniform(gamma, minval=-0.4, maxval=0.4))
    scale = jnp.exp(jax.random.uniform(gain, minval=-0.3, maxval=0.2) + 0.1 * jax.random.normal(cast, (3,)))
    mix = jax.random.uniform(saturation, minval=0.3, maxval=1.5)
    lift = jax.random.uniform(offset, minval=-0.05, maxval=0.05)
    channels = jax.random.permutation(order, 3)

    def tone(rgb):
        bright = jnp.maximum(rgb, 1e-4) ** power * scale + lift
        grey = jnp.mean(bright, axis=-1, keepdims=True)
        return jnp.clip(grey + mix * (bright - grey), 0.0, 1.0)[..., channels]

    clip = example.clip
    clip = clip.replace(rgb=tone(clip.rgb), fill_rgb=tone(clip.fill_rgb))
    return example.replace(clip=clip, clean_rgb=tone(example.clean_rgb))
