"""A rasterizer written in torch as an engine: its picture, the gradient of the workload's loss, and Adam's step."""

from collections.abc import Callable

import torch

from benchmarks.engines.engine import Engine


def torch_engine(draw: Callable, leaves: list[torch.Tensor], target: torch.Tensor, wait: Callable) -> Engine:
    """`draw()` gives the picture of `leaves`, `wait(result)` returns when it is there."""

    def forward():
        with torch.no_grad():
            return draw()

    def gradient():
        return torch.autograd.grad(torch.mean((draw() - target) ** 2), leaves)

    adam = torch.optim.Adam(leaves, lr=1e-3, eps=1e-15)

    def step():
        for leaf, slope in zip(leaves, gradient(), strict=True):
            leaf.grad = slope
        adam.step()

    return Engine(forward, gradient, wait, step)
