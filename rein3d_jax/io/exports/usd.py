"""Scenes as OpenUSD, by usd-core: splats to look at, a mesh to collide with, where one starts and where one may stand.

    /World                Xform, the default prim; metres, Z up, the world's axes
    /World/Splats         ParticleField3DGaussianSplat (OpenUSD >= 26.03): linear scales, opacities after activation,
                          spherical harmonics of display-referred sRGB, as 3DGS has them
    /World/Collider       Mesh with PhysicsCollisionAPI, its triangles as they are; no rigid body, so it never moves.
                          Purpose "guide": physics feels it, pictures do not show it
    /World/StartView      Camera at the input panorama's centre, facing its centre column
    /World/SafeArea       Mesh on the floor, purpose "guide": where a camera may stand

Sources: openusd.org, UsdVol and UsdPhysics schemas; NVIDIA asset requirement VG.035.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path
from rein3d_jax.io.splats.gaussian_columns import FLATTEST, Columns, alive_columns
from rein3d_jax.scene import Gaussians

_REACH = 3.0  # standard deviations of a splat that its extent holds
_FOCAL, _APERTURE = 18.0, 36.0  # tenths of a metre's hundredth, USD's unit of lenses: 90 degrees wide
_ASPECT = 16 / 9


@dataclass(frozen=True)
class UsdScene:
    """What goes into the stage, in the world's axes, metres."""

    splats: Gaussians
    collider: tuple[np.ndarray, np.ndarray]  # vertices (v, 3), faces (f, 3)
    safe_area: (
        np.ndarray
    )  # (p, 3) corners, turning left, of a polygon that is star-shaped round the origin; on the floor
    antialias: bool  # write_ply's


def write_usd(folder: Path, scene: UsdScene) -> list[Path]:
    """Writes scene.usdc and scene.usdz, the same in one package that everything opens, each atomically; returns their
    paths. Raises InputError without usd-core, or if a value of a splat is not finite."""
    usd = _usd()
    layer, package = folder / "scene.usdc", folder / "scene.usdz"
    stage = _stage(usd, scene, alive_columns(scene.splats, layer))
    with atomic_path(layer) as temporary:
        stage.GetRootLayer().Export(str(temporary))
    with atomic_path(package) as temporary:
        if not usd.UsdUtils.CreateNewUsdzPackage(usd.Sdf.AssetPath(str(layer)), str(temporary)):
            raise OSError("the package could not be made")
    return [layer, package]


def _stage(usd, scene: UsdScene, columns: Columns):
    stage = usd.Usd.Stage.CreateInMemory()
    usd.UsdGeom.SetStageUpAxis(stage, usd.UsdGeom.Tokens.z)
    usd.UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    world = usd.UsdGeom.Xform.Define(stage, "/World").GetPrim()
    usd.Usd.ModelAPI(world).SetKind(usd.Kind.Tokens.component)
    world.SetCustomDataByKey("rein3d_jax:antialiased", scene.antialias)
    stage.SetDefaultPrim(world)
    _add_splats(usd, stage, columns)
    collider = _add_mesh(usd, stage, "/World/Collider", *scene.collider)
    usd.UsdPhysics.CollisionAPI.Apply(collider)
    usd.UsdPhysics.MeshCollisionAPI.Apply(collider).CreateApproximationAttr(usd.UsdPhysics.Tokens.none)
    _add_start(usd, stage)
    count = len(scene.safe_area)
    hub = np.mean(scene.safe_area, axis=0) * [0, 0, 1]
    fan = np.stack([np.full(count, count), np.arange(count), (np.arange(count) + 1) % count], axis=1)
    _add_mesh(usd, stage, "/World/SafeArea", np.vstack([scene.safe_area, hub]), fan)
    return stage


def _add_splats(usd, stage, c: Columns) -> None:
    field, vt = usd.UsdVol.ParticleField3DGaussianSplat.Define(stage, "/World/Splats"), usd.Vt
    scales = np.exp(np.maximum(c.log_scales, FLATTEST)).astype(np.float32)
    count, coefficients = c.sh.shape[:2]
    field.CreatePositionsAttr(vt.Vec3fArray.FromNumpy(c.means))
    # A quatf's imaginary part comes first in memory.
    field.CreateOrientationsAttr(vt.QuatfArray.FromNumpy(np.ascontiguousarray(np.roll(c.quats, -1, axis=1))))
    field.CreateScalesAttr(vt.Vec3fArray.FromNumpy(scales))
    opacities = 0.5 + 0.5 * np.tanh(0.5 * c.opacity_logits.astype(np.float64))
    field.CreateOpacitiesAttr(vt.FloatArray.FromNumpy(opacities.astype(np.float32)))
    field.CreateRadianceSphericalHarmonicsDegreeAttr(math.isqrt(coefficients) - 1)
    sh = np.ascontiguousarray(c.sh.reshape(count * coefficients, 3))
    radiance = field.CreateRadianceSphericalHarmonicsCoefficientsAttr(vt.Vec3fArray.FromNumpy(sh))
    radiance.SetMetadata("elementSize", coefficients)  # as NVIDIA's converter says it
    radiance.SetMetadata("interpolation", usd.UsdGeom.Tokens.vertex)
    field.CreateProjectionModeHintAttr(usd.UsdVol.Tokens.perspective)
    field.CreateSortingModeHintAttr(usd.UsdVol.Tokens.cameraDistance)  # as our rasterizer sorts
    reach = _REACH * scales.max(axis=1, keepdims=True)
    field.CreateExtentAttr(_extent(vt, np.vstack([c.means - reach, c.means + reach])))


def _add_mesh(usd, stage, path: str, vertices: np.ndarray, faces: np.ndarray):
    mesh, vt = usd.UsdGeom.Mesh.Define(stage, path), usd.Vt
    mesh.CreatePointsAttr(vt.Vec3fArray.FromNumpy(np.ascontiguousarray(vertices, np.float32)))
    mesh.CreateFaceVertexCountsAttr(vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(vt.IntArray.FromNumpy(np.ascontiguousarray(faces, np.int32).ravel()))
    mesh.CreateSubdivisionSchemeAttr(usd.UsdGeom.Tokens.none)
    mesh.CreatePurposeAttr(usd.UsdGeom.Tokens.guide)
    mesh.CreateExtentAttr(_extent(vt, vertices))
    return mesh.GetPrim()


def _add_start(usd, stage) -> None:
    """USD's cameras look along -Z with +Y up: its columns are the world's right (-Y), up (+Z) and back (-X)."""
    camera = usd.UsdGeom.Camera.Define(stage, "/World/StartView")
    axes = np.array([[0.0, -1, 0, 0], [0, 0, 1, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])  # rows: USD multiplies from the left
    camera.AddTransformOp().Set(usd.Gf.Matrix4d(axes.tolist()))
    camera.CreateFocalLengthAttr(_FOCAL)
    camera.CreateHorizontalApertureAttr(_APERTURE)
    camera.CreateVerticalApertureAttr(_APERTURE / _ASPECT)
    camera.CreateClippingRangeAttr(usd.Gf.Vec2f(0.01, 1000.0))


def _extent(vt, points: np.ndarray):
    return vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float32))


def _usd():
    try:
        import pxr
        from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdUtils, UsdVol, Vt  # noqa: F401
    except ImportError as error:
        raise InputError("OpenUSD needs usd-core: pip install 'rein3d-jax[export]'") from error
    if not hasattr(UsdVol, "ParticleField3DGaussianSplat"):
        raise InputError("OpenUSD knows splats since usd-core 26.3: pip install 'rein3d-jax[export]'")
    return pxr
