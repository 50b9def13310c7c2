"""Laws of making one Gaussian of two near-duplicates."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.covariance import scaled_axes
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.rasterize import rasterize
from rein3d_jax.refine.merge_duplicates import merge_duplicates
from rein3d_jax.refine.views import camera_of
from rein3d_jax.scene import Gaussians


def planted(scene: Gaussians, copies: int = 20, shift: float = 0.0) -> Gaussians:
    """The dead slots filled with copies of the first ones, moved by `shift` of their longest sigma along it."""
    slots = jnp.flatnonzero(~scene.alive)[:copies]
    axes = scaled_axes(scene.log_scales, scene.quats)
    longest = jnp.argmax(scene.log_scales, axis=-1)[:, None, None]
    moved = scene.replace(means=scene.means + shift * jnp.take_along_axis(axes, longest, axis=2)[..., 0])
    return jax.tree.map(lambda x, y: x.at[slots].set(y[: len(slots)]), scene, moved).replace(
        alive=scene.alive.at[slots].set(True)
    )


def living(scene: Gaussians) -> int:
    return int(scene.alive.sum())


def pictures(scene, views, raster):
    frames = [rasterize(scene, camera_of(views, i), config=raster) for i in range(len(views.rgb))]
    assert sum(int(frame.overflow) for frame in frames) == 0
    return np.stack([np.asarray(frame.rgb) for frame in frames])


def test_copies_become_one_in_the_place_of_the_first(toy) -> None:
    scene, _, _ = toy()
    one = merge_duplicates(planted(scene))
    np.testing.assert_array_equal(one.alive, scene.alive)
    np.testing.assert_allclose(one.means[:40], scene.means[:40], atol=1e-6)  # float32, metres of 2
    np.testing.assert_allclose(one.sh[:40], scene.sh[:40], atol=1e-6)
    opacity = jax.nn.sigmoid(scene.opacity_logits[:20])
    np.testing.assert_allclose(jax.nn.sigmoid(one.opacity_logits[:20]), 1 - (1 - opacity) ** 2, atol=1e-6)
    # Two copies of opacity a cover (2 a - a^2 / 2) A, one of 2 a - a^2 must be larger by the quotient.
    growth = jnp.sqrt((2 * opacity - opacity**2 / 2) / (2 * opacity - opacity**2))
    spread = [jnp.linalg.svd(scaled_axes(g.log_scales, g.quats)[:20], compute_uv=False) for g in (one, scene)]
    np.testing.assert_allclose(spread[0], growth[:, None] * spread[1], rtol=1e-5)  # float32 svd


@pytest.mark.parametrize("logit", [-1.0, 0.0, 4.0])
def test_two_copies_show_what_one_shows(toy, raster, logit) -> None:
    """1 - (1 - a g)^2 is no Gaussian; one of equal peak and integral misses it by 0.007, 0.026 and 0.123 where it is
    worst, for opacities 0.27, 0.5 and 0.98; the screen's filter, which does not grow, adds to that."""
    scene, views, _ = toy()
    white = jnp.full_like(scene.sh, 0.5 / C0).at[:, 1:].set(0.0)
    alone = scene.replace(
        alive=jnp.arange(len(scene.alive)) == 0,
        opacity_logits=jnp.full_like(scene.opacity_logits, logit),
        log_scales=scene.log_scales + 1.0,
        sh=white,
    )
    both = planted(alone, copies=1)
    assert living(both) == 2 and living(merge_duplicates(both)) == 1
    before, after = (pictures(g, views, raster) for g in (both, merge_duplicates(both)))
    assert before.max() > 0.2
    a, g = 1 / (1 + np.exp(-logit)), np.linspace(0, 1, 100)
    peak, integral = 2 * a - a**2, 2 * a - a**2 / 2
    worst = np.abs(1 - (1 - a * g) ** 2 - peak * g ** (peak / integral)).max()
    np.testing.assert_allclose(after, before, atol=1.1 * worst + 2 / 255)  # what is under 1/255 is not drawn, twice
    np.testing.assert_allclose(after.mean(), before.mean(), rtol=0.03)  # what leaves the frame, and the filter


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.6])
def test_views_hardly_change(toy, raster, shift) -> None:
    """Half of the 40 doubled, of opacity 0.73: a copy's worst pixel is off by 0.06, and few pixels are."""
    scene, views, _ = toy()
    double = planted(scene, shift=shift)
    one = merge_duplicates(double)
    assert living(one) == 40
    change = np.abs(pictures(one, views, raster) - pictures(double, views, raster))
    lost = np.abs(pictures(scene, views, raster) - pictures(double, views, raster))
    assert change.mean() < 2 / 255  # two grey levels: the law of opacity and size; dropping the copies costs `lost`
    assert change.mean() < lost.mean() / 2


@pytest.mark.parametrize("change", ["apart", "turned", "larger", "colour", "harmonics"])
def test_what_differs_stays(toy, change) -> None:
    scene, _, _ = toy()
    double = planted(scene, shift=1.0 if change == "apart" else 0.0)
    copy = jnp.arange(len(scene.alive)) >= 40
    flat = jnp.where(jnp.arange(3) == 2, -4.0, -1.0) + jnp.zeros((len(copy), 3))  # discs of 37 cm, 2 cm thick
    changed = {
        "apart": {},
        "turned": {"log_scales": flat, "quats": _leaning(double.quats, copy)},
        "larger": {"log_scales": double.log_scales + jnp.where(copy, 0.6, 0.0)[:, None]},
        "colour": {"sh": double.sh.at[:, 0].add(jnp.where(copy, 0.04 / C0, 0.0)[:, None])},
        "harmonics": {"sh": double.sh.at[:, 2].add(jnp.where(copy, 0.04 / C0, 0.0)[:, None])},
    }[change]
    assert living(merge_duplicates(double.replace(**changed))) == 60


def _leaning(quats, copy):
    """Copies turned by half a radian about world x: two walls that cross."""
    turn = jnp.array([np.cos(0.25), np.sin(0.25), 0.0, 0.0])
    w, x, y, z = quats.T
    turned = jnp.stack([turn[0] * w - turn[1] * x, turn[0] * x + turn[1] * w,
                        turn[0] * y - turn[1] * z, turn[0] * z + turn[1] * y], axis=-1)  # fmt: skip
    return jnp.where(copy[:, None], turned, quats)


def test_the_dead_stay_dead_and_the_single_stay_as_they_are(toy) -> None:
    scene, _, _ = toy()
    double = planted(scene, copies=10)
    one = merge_duplicates(double)
    assert not np.any(np.asarray(one.alive & ~double.alive))
    alone = np.arange(60) >= 10  # the copied are the first 10; their copies keep what they held, dead
    for before, after in zip(jax.tree.leaves(double)[:-1], jax.tree.leaves(one)[:-1], strict=True):
        np.testing.assert_array_equal(np.asarray(before)[alone], np.asarray(after)[alone])


def test_many_copies_end_as_one() -> None:
    """Pairs halve a heap, and ties do not lock it: 13 -> 7 -> ... -> 1; then nothing changes."""
    heap = Gaussians(
        jnp.ones((13, 3)), jnp.full((13, 3), -2.0), jnp.eye(1, 4).repeat(13, 0), jnp.full(13, -3.0),
        jnp.zeros((13, 1, 3)), jnp.ones(13, bool),
    )  # fmt: skip
    counts = []
    for _ in range(8):
        heap = merge_duplicates(heap)
        counts.append(living(heap))
    assert counts == sorted(counts, reverse=True) and counts[-1] == 1, counts
    # Opacity 0.047 each; transmittances multiply: 1 - 0.9526^13
    np.testing.assert_allclose(jax.nn.sigmoid(heap.opacity_logits[0]), 1 - (1 - 0.0474259) ** 13, rtol=1e-4)


@pytest.mark.parametrize("unit", [1e-3, 3.7, 1e3])
def test_the_unit_of_length_does_not_matter(toy, unit) -> None:
    scene, _, _ = toy()
    double = planted(scene, shift=0.3)
    scaled = double.replace(means=unit * double.means, log_scales=double.log_scales + np.log(unit))
    one, other = merge_duplicates(double), merge_duplicates(scaled)
    np.testing.assert_array_equal(one.alive, other.alive)
    np.testing.assert_allclose(other.means, unit * one.means, rtol=1e-4, atol=1e-5 * unit)  # float32
    np.testing.assert_allclose(other.log_scales, one.log_scales + np.log(unit), atol=1e-4)
    np.testing.assert_allclose(other.opacity_logits, one.opacity_logits, atol=1e-4)


def test_nothing_becomes_infinite(toy) -> None:
    scene, _, _ = toy()
    odd = planted(scene).replace(quats=jnp.zeros_like(scene.quats))
    odd = odd.replace(opacity_logits=jnp.where(jnp.arange(60) % 2 == 0, 40.0, -40.0), log_scales=odd.log_scales - 15)
    for g in (odd, odd.replace(alive=jnp.zeros_like(odd.alive))):
        one = merge_duplicates(g)
        assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(one))
        assert living(one) == (40 if g is odd else 0)
