"""gsplat's own CUDA kernels, which its package compiles on first use (nvcc and ninja)."""

import gsplat
import torch

from benchmarks.engines.engine import Engine
from benchmarks.engines.torch_engine import torch_engine
from benchmarks.workloads import Workload


def build(workload: Workload) -> Engine:
    """Leaves with gradients on the first GPU. Raises RuntimeError where there is none."""
    if not torch.cuda.is_available():
        raise RuntimeError("gsplat-cuda needs an NVIDIA GPU: leave it out with --engines")
    names, size = ("means", "scales", "quats", "opacities", "colours"), workload.size
    leaves = [torch.tensor(getattr(workload, name), device="cuda", requires_grad=True) for name in names]
    target = torch.tensor(workload.target, device="cuda")
    centre = [[workload.focal, 0, size.width / 2], [0, workload.focal, size.height / 2], [0, 0, 1]]
    intrinsics, pose = torch.tensor([centre], dtype=torch.float32, device="cuda"), torch.eye(4, device="cuda")[None]

    def draw():
        means, scales, quats, opacities, colours = leaves
        given = (means, quats, scales, opacities, colours, pose, intrinsics)
        return gsplat.rasterization(*given, size.width, size.height, packed=False)[0][0]

    return torch_engine(draw, leaves, target, lambda result: torch.cuda.synchronize())
