"""Seconds that making programs takes, as JAX tells them: tracing, lowering, and compiling or reading what was kept."""

from functools import cache

from jax import monitoring

_TRACING = ("/jax/core/compile/jaxpr_trace_duration", "/jax/core/compile/jaxpr_to_mlir_module_duration")
_COMPILING = ("/jax/core/compile/backend_compile_duration",)


@cache
def _total() -> dict[str, float]:
    """Of the process, from the first call on."""
    total = {"trace": 0.0, "compile": 0.0}

    def told(event: str, seconds: float, **_) -> None:
        for name, events in (("trace", _TRACING), ("compile", _COMPILING)):
            total[name] += seconds * (event in events)

    monitoring.register_event_duration_secs_listener(told)
    return total


def program_seconds() -> dict[str, float]:
    """{"trace", "compile"}: seconds so far, over all threads; they run from the first call on."""
    return dict(_total())
