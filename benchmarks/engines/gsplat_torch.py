"""gsplat's torch reference on a CPU, one thread: its own projection, tile lists and accumulation.

Two calls of gsplat.cuda._torch_impl need CUDA: listing the (Gaussian, pixel) pairs of a tile, and nerfacc's sums along
rays. The stand-ins here are vectorised and single-pass; they keep its 1/255 cut and clamp and leave out the stop at
transmittance 1e-4. Its tile lists are made by a loop over Gaussians in Python: `own_lists=False` (the engine
gsplat-torch-vectorised) makes them in plain torch instead, which is more than the reference offers.
"""

import sys
import types

import torch
from gsplat.cuda import _torch_impl, _wrapper

from benchmarks.engines.engine import Engine
from benchmarks.engines.torch_engine import torch_engine
from benchmarks.workloads import Workload

TILE = 16
SPLIT = 2_000_000  # candidate pairs handled at a time, so that memory holds them


@torch.no_grad()
def _indices(start, end, through, means, conics, opacities, width, height, tile, offsets, ids):
    """Stand-in for gsplat's CUDA call: (Gaussian, pixel, image 0) of every alpha of at least 1/255, by pixel and front
    to back. One pass takes all: `start` is 0."""
    means, conics, opacities, starts = means[0], conics[0], opacities[0], offsets.flatten()
    across = offsets.shape[-1]
    counts = torch.diff(starts, append=torch.tensor([len(ids)]))
    tiles = torch.repeat_interleave(torch.arange(len(starts)), counts)
    offset_y, offset_x = torch.meshgrid(torch.arange(tile), torch.arange(tile), indexing="ij")
    parts = []
    for some in torch.arange(len(ids)).split(max(SPLIT // tile**2, 1)):
        x = (tiles[some] % across * tile)[:, None] + offset_x.reshape(1, -1)
        y = (tiles[some] // across * tile)[:, None] + offset_y.reshape(1, -1)
        chosen = ids[some].long()
        dx, dy = x + 0.5 - means[chosen, 0, None], y + 0.5 - means[chosen, 1, None]
        a, b, c = (conics[chosen, i, None] for i in range(3))
        alpha = opacities[chosen, None] * torch.exp(-(0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy))
        keep = (alpha >= 1 / 255) & (x < width) & (y < height)
        parts.append((chosen[:, None].expand_as(keep)[keep], (y * width + x)[keep]))
    ids, pixels = (torch.cat(part) for part in zip(*parts, strict=True))
    order = torch.argsort(pixels, stable=True)
    return ids[order], pixels[order], torch.zeros_like(ids)


def _weights(alphas, ray_indices, n_rays):
    """nerfacc.render_weight_from_alpha for rays in order. In float64: one running sum serves all rays."""
    log_through = torch.log1p(-alphas.double())
    ahead = torch.cumsum(log_through, 0) - log_through
    first = torch.ones_like(ray_indices, dtype=torch.bool)
    first[1:] = ray_indices[1:] != ray_indices[:-1]
    through = torch.exp(ahead - ahead[first][torch.cumsum(first, 0) - 1]).float()
    return alphas * through, through


def _along_rays(weights, values, ray_indices, n_rays):
    """nerfacc.accumulate_along_rays."""
    values = weights[:, None] if values is None else weights[:, None] * values
    return torch.zeros(n_rays, values.shape[-1]).index_add(0, ray_indices, values)


@torch.no_grad()
def _tile_lists(means, radii, depths, tile, across, down):
    """gsplat's `_isect_tiles` for one image, in plain torch: (sort keys, Gaussian ids), by tile and depth."""
    means, radii, depths = means[0], radii[0], depths[0]
    limit = torch.tensor([across, down])
    low = torch.minimum(torch.floor((means - radii) / tile).long().clamp_min(0), limit)
    high = torch.minimum(torch.ceil((means + radii) / tile).long().clamp_min(0), limit)
    size = (high - low).clamp_min(0) * (radii > 0).all(-1, keepdim=True)
    count = size.prod(-1)
    owner = torch.repeat_interleave(torch.arange(len(count)), count)
    rank = torch.arange(len(owner)) - (torch.cumsum(count, 0) - count)[owner]
    tiles = (low[owner, 1] + rank // size[owner, 0]) * across + low[owner, 0] + rank % size[owner, 0]
    keys, order = torch.sort((tiles << 32) | depths[owner].view(torch.int32).long())
    return keys, owner[order].int()


def _install_stand_ins():
    _wrapper.rasterize_to_indices_in_range = _indices
    nerfacc = types.ModuleType("nerfacc")
    nerfacc.render_weight_from_alpha, nerfacc.accumulate_along_rays = _weights, _along_rays
    sys.modules["nerfacc"] = nerfacc


def render(means, scales, quats, opacities, colours, focal: float, width: int, height: int, own_lists: bool = True):
    """(height, width, 3) over black; the camera stands at the origin."""
    _install_stand_ins()
    covariance, _ = _torch_impl._quat_scale_to_covar_preci(quats, scales, compute_preci=False)
    intrinsics = torch.tensor([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], dtype=torch.float32)
    radii, flat, depths, conics, _ = _torch_impl._fully_fused_projection(
        means, covariance, torch.eye(4)[None], intrinsics[None], width, height
    )
    across, down = -(-width // TILE), -(-height // TILE)
    if own_lists:
        _, keys, ids = _torch_impl._isect_tiles(flat, radii, depths, TILE, across, down)
    else:
        keys, ids = _tile_lists(flat, radii, depths, TILE, across, down)
    offsets = _torch_impl._isect_offset_encode(keys, 1, across, down)
    image, _ = _torch_impl._rasterize_to_pixels(
        flat, conics, colours[None], opacities[None], width, height, TILE, offsets, ids, batch_per_iter=1 << 30
    )
    return image[0]


def build(workload: Workload, own_lists: bool = True) -> Engine:
    """Leaves with gradients; one torch thread."""
    torch.set_num_threads(1)
    names = ("means", "scales", "quats", "opacities", "colours")
    leaves = [torch.tensor(getattr(workload, name), requires_grad=True) for name in names]
    target, size = torch.tensor(workload.target), workload.size

    def draw():
        return render(*leaves, workload.focal, size.width, size.height, own_lists)

    return torch_engine(draw, leaves, target, lambda result: result)
