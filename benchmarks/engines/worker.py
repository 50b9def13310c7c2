"""One engine in a process of its own: built once, then timed when told to, so that engines alternate."""

import importlib
import multiprocessing
import os
import resource
import time

from benchmarks.workloads import SIZES, make_workload

ENGINES = {
    "rein3d_jax": "benchmarks.engines.ours",
    "prototype": "benchmarks.engines.prototype",
    "gsplat-torch": "benchmarks.engines.gsplat_torch",
    "gsplat-torch-vectorised": "benchmarks.engines.gsplat_vectorised",
    "gsplat-cuda": "benchmarks.engines.gsplat_cuda",  # for an NVIDIA GPU
}
ON_CPU = [name for name in ENGINES if name != "gsplat-cuda"]
INSTALL = {name: "pip install -e '.[bench]'" for name in ENGINES if name.startswith("gsplat")}


class Worker:
    """`ask(what, repeats)` -> list of (wall, CPU) seconds; `facts` is what building found out."""

    def __init__(self, engine: str, workload: str):
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, engine, workload), daemon=True)
        self._process.start()
        self.facts = self._receive()

    def ask(self, what: str, repeats: int = 1) -> list[tuple[float, float]]:
        """Time "forward", "gradient", "step" or one of the engine's parts."""
        self._pipe.send((what, repeats))
        return self._receive()

    def close(self) -> int:
        """Ends the process; bytes by which its memory had grown at most since before the engine was built."""
        grown = self.ask("peak")
        self._process.terminate()
        self._process.join()
        return grown

    def _receive(self):
        answer = self._pipe.recv()
        if isinstance(answer, Exception):
            raise answer
        return answer


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _serve(pipe, name: str, workload_name: str) -> None:
    try:
        module = importlib.import_module(ENGINES[name])
        if getattr(module, "ONE_CORE", False):
            os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        workload = make_workload(SIZES[workload_name])
        before = _peak()
        engine, compiled = _built(module, workload)
        pipe.send({**engine.facts, "compile_s": compiled, "parts": list(engine.parts)})
    except Exception as error:
        pipe.send(RuntimeError(f"{name}: {type(error).__name__}: {error}"))
        return
    calls = {"forward": engine.forward, "gradient": engine.gradient, "step": engine.step, **engine.parts}
    while True:
        what, repeats = pipe.recv()
        pipe.send(_peak() - before if what == "peak" else [_timed(calls[what], engine.wait) for _ in range(repeats)])


def _built(module, workload):
    """The engine, and seconds of building it and of its first calls."""
    started = time.perf_counter()
    engine = module.build(workload)
    for call in (engine.forward, engine.gradient, *engine.parts.values()):
        engine.wait(call())
    return engine, time.perf_counter() - started


def _timed(call, wait) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    wait(call())
    return time.perf_counter() - wall, time.process_time() - cpu
