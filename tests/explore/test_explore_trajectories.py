"""Laws of Algorithm 1."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.errors import InputError
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.explore.trajectories import Trajectories, radial_trajectories
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.scene import Panorama

HEIGHT, WIDTH = 20, 40  # rows 9 and 10 are the band
CONFIG = ExploreConfig(trajectories=4)


def panorama(profile: np.ndarray, valid: np.ndarray | None = None) -> Panorama:
    shape = (HEIGHT, len(profile))
    known = np.ones(shape, bool) if valid is None else np.broadcast_to(valid, shape)
    return Panorama(
        jnp.zeros((*shape, 3)), jnp.asarray(np.broadcast_to(profile, shape), jnp.float32), jnp.asarray(known)
    )


def random_profile(seed: int, low: float = 0.2, high: float = 6.0) -> np.ndarray:
    return np.asarray(jax.random.uniform(jax.random.key(seed), (WIDTH,), minval=low, maxval=high))


def used(paths: Trajectories) -> np.ndarray:
    frames = np.arange(paths.positions.shape[1])
    return np.asarray(paths.positions)[frames < np.asarray(paths.counts)[:, None]]


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.floats(0.05, 3))
def test_paths_keep_their_clearance_from_band_geometry(seed: int, low: float) -> None:
    """Points of the band in 3D, every row with its own distance; an origin nearer than the clearance gets no nearer."""
    distance = jax.random.uniform(jax.random.key(seed), (HEIGHT, WIDTH), minval=low, maxval=6.0)
    pano = Panorama(jnp.zeros((HEIGHT, WIDTH, 3)), distance, jnp.ones((HEIGHT, WIDTH), bool))
    points = np.asarray(pixel_rays(HEIGHT, WIDTH) * distance[..., None])[9:11].reshape(-1, 1, 3)
    positions = used(radial_trajectories(pano, config=CONFIG))
    gap = np.linalg.norm(points - positions, axis=-1)
    own = np.linalg.norm(points, axis=-1)
    assert np.all(gap >= np.minimum(own, CONFIG.clearance) - 1e-5)  # float32, metres up to 6


def test_an_open_square_is_crossed_into_its_corners() -> None:
    """The corners of a square room are farthest; the search must find its diagonals."""
    azimuth = (np.arange(WIDTH) + 0.5) / WIDTH * 2 * np.pi - np.pi
    profile = 3 / np.maximum(np.abs(np.cos(azimuth)), np.abs(np.sin(azimuth)))
    paths = radial_trajectories(panorama(profile), config=CONFIG)
    turn = np.mod(np.asarray(paths.directions), np.pi / 2) - np.pi / 4
    assert np.all(np.abs(turn) <= np.pi / WIDTH + 1e-6)  # the nearest column centre
    assert np.all(np.asarray(paths.lengths) > 3)


def test_frames_are_steps_along_the_direction() -> None:
    paths = radial_trajectories(panorama(random_profile(0)), config=CONFIG)
    positions, counts = np.asarray(paths.positions), np.asarray(paths.counts)
    for path, count, phi, length in zip(positions, counts, paths.directions, paths.lengths, strict=True):
        along = np.arange(count) * CONFIG.step
        assert along[-1] <= length < along[-1] + CONFIG.step
        expected = along[:, None] * np.array([np.cos(phi), -np.sin(phi), 0])
        np.testing.assert_allclose(path[:count], expected, atol=1e-5)  # float32, metres up to 6
        assert np.all(path[count:] == path[count - 1])
    np.testing.assert_array_equal(paths.world_from_camera[..., :3, 3], positions)
    axes = np.broadcast_to(world_from_camera_axes(), (*positions.shape, 3))
    np.testing.assert_array_equal(paths.world_from_camera[..., :3, :3], axes)


def test_rotation_is_the_best_of_brute_force() -> None:
    for seed in range(5):
        paths = radial_trajectories(panorama(random_profile(seed)), config=CONFIG)
        score = np.asarray(paths.safe).reshape(4, WIDTH // 4).sum(axis=0)  # column c, c + W/4, ...
        chosen = np.mod(np.floor(np.asarray(paths.directions) / (2 * np.pi / WIDTH)) + WIDTH // 2, WIDTH).astype(int)
        assert np.asarray(paths.safe)[chosen].sum() == pytest.approx(score.max(), rel=1e-5)  # float32 sums
        assert 0 <= paths.rotation < np.pi / 2


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.integers(1, WIDTH - 1))
def test_yawed_panorama_gives_yawed_paths(seed: int, columns: int) -> None:
    profile = random_profile(seed, low=2.0)
    here = radial_trajectories(panorama(profile), config=CONFIG)
    there = radial_trajectories(panorama(np.roll(profile, columns)), config=CONFIG)
    turn = columns * 2 * np.pi / WIDTH
    ends = np.stack([np.cos(here.directions + turn), np.sin(here.directions + turn)]) * np.asarray(here.lengths)
    rolled = np.stack([np.cos(there.directions), np.sin(there.directions)]) * np.asarray(there.lengths)
    # The same set of ends, whichever path is called the first; equal scores could choose another rotation, so compare
    # the sum reached too: it is equal to float32 rounding.
    assert np.asarray(here.lengths).sum() == pytest.approx(np.asarray(there.lengths).sum(), abs=1e-3)
    gaps = np.abs(ends[:, :, None] - rolled[:, None]).max(axis=0).min(axis=1)
    score = np.sort(np.asarray(here.safe).reshape(4, -1).sum(axis=0))
    if score[-1] - score[-2] > 1e-3:
        assert np.all(gaps < 1e-3)


def test_a_path_longer_than_its_buffer_says_so() -> None:
    far = panorama(np.full(WIDTH, 5.0))
    whole = radial_trajectories(far, config=CONFIG)
    assert np.all(np.asarray(whole.overflow) == 0)
    short = radial_trajectories(far, config=replace(CONFIG, max_frames=6))
    assert short.positions.shape == (4, 6, 3)
    np.testing.assert_array_equal(short.counts, 6)
    np.testing.assert_array_equal(short.overflow + short.counts, whole.counts)


@pytest.mark.parametrize("nothing", ["zero", "unknown", "tight"])
def test_without_room_every_path_is_the_origin(nothing: str) -> None:
    profile = np.full(WIDTH, {"zero": 0.0, "unknown": 5.0, "tight": 0.35}[nothing])
    paths = radial_trajectories(panorama(profile, np.array(nothing != "unknown")), config=CONFIG)
    np.testing.assert_array_equal(paths.counts, 1)
    np.testing.assert_array_equal(paths.positions, 0)
    assert np.all(np.isfinite(paths.world_from_camera))


@pytest.mark.parametrize("count", [1, 7, 64, 100])
def test_any_number_of_trajectories(count: int) -> None:
    """One, a number that does not divide the columns, and more than there are columns: an even fan, all of it safe,
    the longest path first."""
    profile = random_profile(3)
    paths = radial_trajectories(panorama(profile), config=replace(CONFIG, trajectories=count))
    fan = np.sort(paths.directions)
    np.testing.assert_allclose(np.diff(fan), 2 * np.pi / count, atol=1e-5)  # float32 angles up to 2 pi
    assert np.all(np.diff(paths.lengths) <= 0)
    assert paths.counts.shape == (count,)
    points = np.asarray(pixel_rays(HEIGHT, WIDTH) * profile[:, None])[9:11].reshape(-1, 1, 3)
    gap = np.linalg.norm(points - used(paths), axis=-1)
    assert np.all(gap >= np.minimum(np.linalg.norm(points, axis=-1), CONFIG.clearance) - 1e-5)


@pytest.mark.parametrize("length", [0.0, 0.6, 100.0])
def test_no_path_is_longer_than_the_longest_allowed_and_a_far_limit_changes_nothing(length: float) -> None:
    free = radial_trajectories(panorama(random_profile(3)), config=CONFIG)
    held = radial_trajectories(panorama(random_profile(3)), config=replace(CONFIG, max_length=length))
    np.testing.assert_array_equal(held.lengths, np.minimum(free.lengths, np.float32(length)))
    np.testing.assert_array_equal(held.directions, free.directions)
    assert np.all(np.linalg.norm(np.asarray(held.positions), axis=-1) <= length + 1e-6)  # float32 unit vectors


@pytest.mark.parametrize(
    "bad", [{"trajectories": 0}, {"step": 0.0}, {"max_length": -1.0}, {"band": (0.6, 0.4)}, {"min_revealed": 1.0}]
)
def test_bad_settings_are_refused_by_name(bad: dict) -> None:
    with pytest.raises(InputError, match=next(iter(bad))):
        ExploreConfig(**bad)


def test_a_doubtful_distance_counts_as_so_much_shorter() -> None:
    profile = random_profile(3)
    doubtful = panorama(profile).replace(doubt=jnp.full((HEIGHT, WIDTH), 0.25))
    shorter = radial_trajectories(panorama(0.75 * profile), config=CONFIG)
    np.testing.assert_allclose(
        radial_trajectories(doubtful, config=CONFIG).positions, shorter.positions, atol=1e-5
    )  # float32, metres up to 6
