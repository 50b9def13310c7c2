"""The quicker way to compile is asked for, and never against the user."""

import os

import pytest

from experiments.quick_compilation import compile_quickly

QUICK = "--xla_cpu_use_fusion_emitters=false"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (None, QUICK),
        ("--xla_dump_to=x", f"{QUICK} --xla_dump_to=x"),
        ("--xla_cpu_use_fusion_emitters=true", "--xla_cpu_use_fusion_emitters=true"),
    ],
)
def test_the_users_own_flags_stay_and_win(monkeypatch, before, after):
    monkeypatch.delenv("XLA_FLAGS", raising=False)
    if before is not None:
        monkeypatch.setenv("XLA_FLAGS", before)
    for _ in range(2):  # asked for twice is asked for once
        compile_quickly()
        assert os.environ["XLA_FLAGS"] == after
