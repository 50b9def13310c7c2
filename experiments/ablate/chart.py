"""The chart of an ablation: what each variant gains and costs, by sampler steps."""

import io
from pathlib import Path

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes


def ablation_chart(variants: dict, sampler_steps: tuple[int, ...], picture: Path) -> None:
    """Writes the chart of `variants`, as experiments.ablate writes them. Raises InputError without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError('--picture draws with matplotlib: pip install "rein3d-jax[bench]"') from error
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    for name, scores in variants.items():
        seconds, gains = ([scores[f"{key}_{n}"]["mean"] for n in sampler_steps] for key in ("seconds", "gain"))
        spread = [scores[f"gain_{n}"]["sem"] or 0.0 for n in sampler_steps]
        line, *_ = axes.errorbar(seconds, gains, yerr=spread, marker="o", capsize=3, label=name)
        for step, x, y in zip(sampler_steps, seconds, gains, strict=True):
            axes.annotate(
                str(step), (x, y), xytext=(4, 4), textcoords="offset points", fontsize=8, color=line.get_color()
            )
    axes.set(xscale="log", xlabel="seconds a clip, log scale; numbers are sampler steps")
    axes.set_ylabel("hole PSNR over the background fill, dB")
    axes.grid(alpha=0.3)
    axes.legend()
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=110, metadata={"Software": None})
    write_bytes(picture, drawn.getvalue())
