"""A stage written, opened by usd-core and compared field by field; its validators find nothing."""

import sys

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdValidation, UsdVol

from rein3d_jax.errors import InputError
from rein3d_jax.io.exports.usd import UsdScene, write_usd
from rein3d_jax.scene import Gaussians

N = 9
VERTICES = np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0, 0, 2.5]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
CORNERS = np.array([[1.0, 0, -1.6], [0, 1, -1.6], [-2, 0, -1.6], [0, -1, -1.6]])


def splats(degree):
    rng = np.random.default_rng(degree)
    normal = lambda *shape: rng.standard_normal((N, *shape)).astype(np.float32)  # noqa: E731
    quats = normal(4)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    return Gaussians(normal(3), normal(3), quats, normal(), normal((degree + 1) ** 2, 3), np.arange(N) != 3)


@pytest.fixture(scope="module", params=[0, 3])
def written(request, tmp_path_factory):
    folder, scene = tmp_path_factory.mktemp("usd"), splats(request.param)
    assert write_usd(folder, UsdScene(scene, (VERTICES, FACES), CORNERS, True)) == [
        folder / "scene.usdc", folder / "scene.usdz"]  # fmt: skip
    return folder, scene


@pytest.fixture(params=["usdc", "usdz"])
def stage(request, written):
    return Usd.Stage.Open(str(written[0] / f"scene.{request.param}"))


def test_the_stage_is_in_metres_with_z_up(stage):
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert {str(prim.GetPath()) for prim in stage.Traverse()} == {
        "/World", "/World/Splats", "/World/Collider", "/World/StartView", "/World/SafeArea"}  # fmt: skip


def test_every_field_of_the_splats_comes_back(stage, written):
    scene = written[1]
    alive, field = scene.alive, UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath("/World/Splats"))
    np.testing.assert_array_equal(field.GetPositionsAttr().Get(), scene.means[alive])
    np.testing.assert_allclose(field.GetScalesAttr().Get(), np.exp(scene.log_scales[alive]), rtol=1e-6)  # float32
    alpha = 1 / (1 + np.exp(-scene.opacity_logits[alive].astype(float)))
    np.testing.assert_allclose(field.GetOpacitiesAttr().Get(), alpha, rtol=1e-6)
    quats = [(q.GetReal(), *q.GetImaginary()) for q in field.GetOrientationsAttr().Get()]
    np.testing.assert_allclose(quats, scene.quats[alive], atol=2e-7)  # made unit once more
    np.testing.assert_allclose(np.linalg.norm(quats, axis=1), 1, atol=2e-7)
    coefficients = field.GetRadianceSphericalHarmonicsCoefficientsAttr()
    count = scene.sh.shape[1]
    np.testing.assert_array_equal(np.reshape(coefficients.Get(), (-1, count, 3)), scene.sh[alive])
    assert (field.GetRadianceSphericalHarmonicsDegreeAttr().Get() + 1) ** 2 == count
    assert coefficients.GetMetadata("elementSize") == count
    assert field.GetProjectionModeHintAttr().Get() == "perspective"
    assert field.GetSortingModeHintAttr().Get() == "cameraDistance"
    low, high = np.array(field.GetExtentAttr().Get())
    assert (low <= scene.means[alive].min(0)).all() and (high >= scene.means[alive].max(0)).all()


def test_bodies_collide_with_the_mesh_and_nobody_sees_it(stage):
    prim = stage.GetPrimAtPath("/World/Collider")
    mesh = UsdGeom.Mesh(prim)
    np.testing.assert_array_equal(mesh.GetPointsAttr().Get(), np.float32(VERTICES))
    np.testing.assert_array_equal(np.reshape(mesh.GetFaceVertexIndicesAttr().Get(), (-1, 3)), FACES)
    assert prim.HasAPI(UsdPhysics.CollisionAPI) and UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get()
    assert UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() == "none"
    assert not prim.HasAPI(UsdPhysics.RigidBodyAPI)  # static
    assert mesh.GetPurposeAttr().Get() == "guide" and mesh.GetSubdivisionSchemeAttr().Get() == "none"


def test_one_starts_at_the_panorama_s_centre_and_faces_its_centre_column(stage):
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/StartView")).GetCamera()
    frustum = camera.frustum
    assert np.allclose(frustum.GetPosition(), 0)
    np.testing.assert_allclose(frustum.ComputeViewDirection(), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(frustum.ComputeUpVector(), [0, 0, 1], atol=1e-12)
    assert camera.GetFieldOfView(Gf.Camera.FOVHorizontal) == pytest.approx(90)


def test_the_safe_area_is_the_polygon_on_the_floor(stage):
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/SafeArea"))
    points = np.array(mesh.GetPointsAttr().Get())
    corners = points[np.reshape(mesh.GetFaceVertexIndicesAttr().Get(), (-1, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all() and np.allclose(normals[:, :2], 0)  # it faces up
    x, y = CORNERS[:, 0], CORNERS[:, 1]
    assert normals[:, 2].sum() == pytest.approx(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))  # the shoelace formula


def test_usd_core_s_validators_find_nothing(stage):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not [f"{fault.GetName()}: {fault.GetMessage()}" for fault in found]


def test_what_cannot_be_written_is_refused(tmp_path, monkeypatch):
    bad = splats(0)
    bad.means[0] = np.nan
    with pytest.raises(InputError, match=r"scene.usdc: 3 values of its 8 Gaussians are not finite"):
        write_usd(tmp_path, UsdScene(bad, (VERTICES, FACES), CORNERS, False))
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(InputError, match=r"usd-core: pip install 'rein3d-jax\[export\]'"):
        write_usd(tmp_path, UsdScene(splats(0), (VERTICES, FACES), CORNERS, False))
    assert not list(tmp_path.iterdir())
