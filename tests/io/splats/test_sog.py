"""SOG: decoded here by the format's papers, each value is within its step of what was written."""

import json
import zipfile

import cv2
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.splats.codebook import scalar_codebook, vector_palette
from rein3d_jax.io.splats.compressed_ply import morton_order
from rein3d_jax.io.splats.gaussian_file import write_splats
from rein3d_jax.scene import Gaussians

N = 700  # no multiple of a texture's side


def scene(degree):
    rng = np.random.default_rng(degree)
    quats = rng.standard_normal((N, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    sh = 0.3 * rng.standard_normal((N, (degree + 1) ** 2, 3))
    fields = (rng.uniform(-9, 9, (N, 3)), rng.uniform(-6, 1, (N, 3)), quats, rng.uniform(-5, 5, N), sh)
    return Gaussians(*(field.astype(np.float32) for field in fields), np.ones(N, bool))


def rgba(image):
    """OpenCV leaves out an alpha that is 255 everywhere."""
    alpha = image[..., 3:] if image.shape[2] == 4 else np.full_like(image[..., :1], 255)
    return np.concatenate([image[..., 2::-1], alpha], axis=-1)


def off_the_nearest(got, wanted, book):
    """Largest difference to the best that the codebook offers."""
    best = np.abs(wanted[..., None] - np.array(book)).min(axis=-1)
    return np.abs(np.abs(got - wanted) - best).max()


def decoded(path):
    with zipfile.ZipFile(path) as archive:
        meta = json.loads(archive.read("meta.json"))
        bgra = {name: cv2.imdecode(np.frombuffer(archive.read(name), np.uint8), cv2.IMREAD_UNCHANGED)
                for name in archive.namelist() if name.endswith(".webp")}  # fmt: skip
    texels = {name: rgba(image).astype(np.int64) for name, image in bgra.items()}
    assert all(side % 4 == 0 for name, t in texels.items() if "centroids" not in name for side in t.shape[:2])
    return meta, texels


@pytest.mark.parametrize("degree", [0, 2])
def test_each_value_is_within_its_step(tmp_path, degree):
    wanted = scene(degree)
    write_splats(tmp_path / "x.sog", wanted, antialias=True)
    meta, texels = decoded(tmp_path / "x.sog")
    flat = {name: t.reshape(-1, 4)[:N] for name, t in texels.items()}
    order = morton_order(wanted.means)
    assert (meta["version"], meta["count"], meta["model"]) == (2, N, "antialiased")
    low, high = np.array(meta["means"]["mins"]), np.array(meta["means"]["maxs"])
    logs = low + (high - low) * (flat["means_l.webp"] + 256 * flat["means_u.webp"])[:, :3] / 65535
    means = np.sign(logs) * np.expm1(np.abs(logs))
    # Half of 1/65535 of the bounds in logs, times 1 + |x| <= 10.
    np.testing.assert_allclose(means, wanted.means[order], atol=10 * (high - low).max() / 65535)
    packed = flat["quats.webp"]
    largest, others = packed[:, 3] - 252, (packed[:, :3] / 255 * 2 - 1) / np.sqrt(2)
    got = np.stack([np.insert(o, k, np.sqrt(max(0, 1 - (o**2).sum()))) for o, k in zip(others, largest, strict=True)])
    dots = np.abs((got * wanted.quats[order]).sum(axis=1))
    assert np.arccos(np.minimum(dots, 1)).max() < 2 * np.sqrt(3) * np.sqrt(2) * 0.5 / 255 + 1e-3  # 1/w <= 2; arccos
    for name, key, values in (("scales.webp", "scales", wanted.log_scales), ("sh0.webp", "sh0", wanted.sh[:, 0])):
        book = np.array(meta[key]["codebook"])
        got = book[flat[name][:, :3]]
        assert off_the_nearest(got, values[order], book) < 1e-6  # float32 beside float64
        assert np.sqrt(np.mean((got - values[order]) ** 2)) < np.ptp(values) / 255 / np.sqrt(12)  # even steps
    alpha = 1 / (1 + np.exp(-wanted.opacity_logits[order]))
    np.testing.assert_allclose(flat["sh0.webp"][:, 3] / 255, alpha, atol=0.51 / 255)
    if degree:
        told, labels = meta["shN"], flat["shN_labels.webp"][:, 0] + 256 * flat["shN_labels.webp"][:, 1]
        k = wanted.sh.shape[1] - 1
        assert told["bands"] == degree and texels["shN_centroids.webp"].shape[1] == 64 * k and labels.max() < N
        entries = texels["shN_centroids.webp"][..., :3].reshape(-1, k, 3)[labels]
        got = np.array(told["codebook"])[entries]
        # Fewer vectors than entries: each has its own, and the codebook alone rounds.
        assert off_the_nearest(got, wanted.sh[order, 1:], told["codebook"]) < 1e-6


def test_the_same_scene_gives_the_same_bytes(tmp_path):
    for name in ("a.sog", "b.sog"):
        write_splats(tmp_path / name, scene(1))
    assert (tmp_path / "a.sog").read_bytes() == (tmp_path / "b.sog").read_bytes()


def test_codebooks_choose_the_nearest_and_lower_the_error():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.standard_normal(3000), [50.0]])
    book, index = scalar_codebook(values, 64)
    assert (np.diff(book) >= 0).all()
    np.testing.assert_array_equal(np.abs(values - book[index]), np.abs(values[:, None] - book).min(axis=1))
    even = np.linspace(values.min(), values.max(), 64)
    assert np.mean((values - book[index]) ** 2) < 0.05 * np.mean(np.abs(values[:, None] - even).min(axis=1) ** 2)
    vectors = rng.standard_normal((500, 3)).astype(np.float32)
    palette, chosen = vector_palette(vectors, 32)
    far = np.linalg.norm(vectors[:, None] - palette, axis=2)
    np.testing.assert_allclose(far[np.arange(500), chosen], far.min(axis=1), atol=1e-3)  # by |p|^2 - 2 v.p in float32
    assert np.mean(far.min(axis=1) ** 2) < np.mean(np.linalg.norm(vectors[:, None] - vectors[:32], axis=2).min(1) ** 2)


def test_what_sog_cannot_hold_is_refused(tmp_path):
    empty = scene(0).replace(alive=np.zeros(N, bool))
    with pytest.raises(InputError, match=r"x.sog: the scene is empty, which SOG cannot hold: write a PLY"):
        write_splats(tmp_path / "x.sog", empty)
    assert not list(tmp_path.iterdir())
