"""Normalisations and softmax attention, as plain functions; statistics and logits are float32 whatever comes in."""

from functools import partial

import jax
import jax.numpy as jnp


def rms_norm(x: jax.Array, scale: jax.Array, epsilon: float) -> jax.Array:
    """Norm x / sqrt(mean(x^2) + epsilon) * scale over the last axis. Wan takes it over ALL heads at once."""
    wide = x.astype(_accumulator(x))
    mean = jnp.mean(jnp.square(wide), axis=-1, keepdims=True)
    return (wide * jax.lax.rsqrt(mean + epsilon) * scale).astype(x.dtype)


def layer_norm(x: jax.Array, epsilon: float) -> jax.Array:
    """Norm (x - mean) / sqrt(variance + epsilon) over the last axis, without parameters; stays in float32."""
    wide = x.astype(_accumulator(x))
    centred = wide - wide.mean(axis=-1, keepdims=True)
    return centred * jax.lax.rsqrt(jnp.square(centred).mean(axis=-1, keepdims=True) + epsilon)


def attend(
    query: jax.Array, key: jax.Array, value: jax.Array, *, kernel: str = "chunked", chunk: int = 1024
) -> jax.Array:
    """Attention softmax(q k^T / sqrt(d)) v: queries (b, n, h, d), keys and values (b, m, h, d) -> (b, n, h, d).

    "chunked" takes `chunk` queries at a time and recomputes their logits in the backward pass, so that memory grows
    as chunk * m; the other kernels are those of jax.nn.dot_product_attention.
    """
    if kernel != "chunked":
        return jax.nn.dot_product_attention(query, key, value, implementation=kernel)
    count = query.shape[1]
    if count <= chunk:
        return _attend_at_once(query, key, value)
    padded = jnp.pad(query, ((0, 0), (0, -count % chunk), (0, 0), (0, 0)))
    chunks = padded.reshape(padded.shape[0], -1, chunk, *padded.shape[2:]).swapaxes(0, 1)
    out = jax.lax.map(jax.checkpoint(partial(_attend_at_once, key=key, value=value)), chunks)
    return out.swapaxes(0, 1).reshape(padded.shape)[:, :count]


def _attend_at_once(query, key, value):
    wide = _accumulator(query)
    logits = jnp.einsum("bnhd,bmhd->bhnm", query, key, preferred_element_type=wide) * query.shape[-1] ** -0.5
    weights = jax.nn.softmax(logits, axis=-1).astype(value.dtype)
    return jnp.einsum("bhnm,bmhd->bnhd", weights, value)


def _accumulator(x):
    return jnp.promote_types(x.dtype, jnp.float32)
