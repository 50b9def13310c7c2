"""Clone, split, prune and opacity reset in buffers of fixed size (3DGS Sec. 5.2; paper Table 3dgs_refine_details)."""

import jax
import jax.numpy as jnp
import optax

from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.refine.config import DensifyConfig
from rein3d_jax.refine.state import RefineState

SHRINK = 1.6  # a split Gaussian's children have 1/1.6 of its scale (3DGS)
RESET_OPACITY = 0.01  # 3DGS: twice the pruning threshold and a little more, so a reset alone prunes nothing


def forget(optimizer: optax.OptState, slots: jax.Array) -> optax.OptState:
    """Zero the moments of `slots` (n,) bool: what a recycled slot remembers belongs to another Gaussian."""
    count = slots.shape[0]

    def clear(x):
        per_slot = hasattr(x, "shape") and x.ndim > 0 and x.shape[0] == count
        return jnp.where(slots.reshape(-1, *[1] * (x.ndim - 1)), 0, x) if per_slot else x

    return jax.tree.map(clear, optimizer)


def _densify(state: RefineState, key: jax.Array, *, config: DensifyConfig):
    """Grow where the 2D gradient is high, prune what is faint: (state, counts).

    A high-gradient Gaussian smaller than `split_size` x extent is cloned; a larger one is split into two drawn from
    it. Each takes ONE free slot; the steepest go first, `share` of the buffer at most, the rest next time.
    Those that found no slot are counted as overflow.
    """
    parameters, alive = state.parameters, state.alive
    count = alive.shape[0]
    mean_gradient = jnp.where(alive, state.gradient_sum / jnp.maximum(state.seen, 1.0), 0.0)
    wanted = mean_gradient > config.gradient
    room = max(int(config.share * count), 1)
    steepest, parents = jax.lax.top_k(jnp.where(wanted, mean_gradient, 0.0), room)
    free = jnp.nonzero(~alive, size=room, fill_value=count)[0]
    placed = (steepest > 0) & (free < count)
    target = jnp.where(placed, free, count)
    parent = jnp.where(placed, parents, count)

    size = jnp.exp(jnp.max(parameters["log_scales"][parents], axis=-1))
    split = (size > config.split_size * state.extent)[:, None]
    offsets = _draw(parameters, parents, key)  # (2, room, 3)
    shrink = jnp.where(split, jnp.log(SHRINK), 0.0)
    children = {name: value[parents] for name, value in parameters.items()}
    children["log_scales"] = children["log_scales"] - shrink
    first = children | {"means": children["means"] + jnp.where(split, offsets[0], 0.0)}
    second = children | {"means": children["means"] + jnp.where(split, offsets[1], 0.0)}
    grown = {
        name: parameters[name].at[parent].set(first[name], mode="drop").at[target].set(second[name], mode="drop")
        for name in parameters
    }
    alive = alive.at[target].set(True, mode="drop")
    floor = state.floor.at[target].set(state.floor[parents], mode="drop")
    # A clone's original keeps its moments; split ones and new ones start afresh.
    fresh = jnp.zeros(count, bool).at[target].set(True, mode="drop")
    fresh = fresh.at[jnp.where(split[:, 0], parent, count)].set(True, mode="drop")

    faint = jax.nn.sigmoid(grown["opacity_logits"]) < config.prune_opacity
    huge = jnp.exp(jnp.max(grown["log_scales"], axis=-1)) > config.prune_size * state.extent
    pruned = alive & (faint | (huge & (state.step > config.reset_every)))
    zeros = jnp.zeros(count)
    counts = {"added": placed.sum(), "pruned": pruned.sum(), "overflow": (steepest > 0).sum() - placed.sum()}
    new = state.replace(
        parameters=grown, alive=alive & ~pruned, floor=floor, optimizer=forget(state.optimizer, fresh | pruned),
        gradient_sum=zeros, seen=zeros,
    )  # fmt: skip
    return new, counts


def _draw(parameters, ids, key):
    """(2, len(ids), 3) displacements drawn from each Gaussian."""
    noise = jax.random.normal(key, (2, ids.shape[0], 3)) * jnp.exp(parameters["log_scales"][ids])
    return jnp.einsum("nij,knj->kni", matrix_from_quats(parameters["quats"][ids]), noise, precision="highest")


def _reset_opacity(state: RefineState) -> RefineState:
    """Opacity at most RESET_OPACITY, its moments forgotten: what the views need comes back, floaters do not."""
    ceiling = jnp.log(RESET_OPACITY / (1 - RESET_OPACITY))
    logits = jnp.minimum(state.parameters["opacity_logits"], ceiling)
    inner = dict(state.optimizer.inner_states)
    inner["opacity_logits"] = forget(inner["opacity_logits"], jnp.ones_like(state.alive))
    optimizer = state.optimizer._replace(inner_states=inner)
    return state.replace(parameters=state.parameters | {"opacity_logits": logits}, optimizer=optimizer)


densify = jax.jit(_densify, static_argnames=("config",))
reset_opacity = jax.jit(_reset_opacity)
