"""The quicker way to compile is asked for, and never against the user."""

import gc
import os

import pytest

from experiments.quick_process import begin_quickly

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
        begin_quickly()
        assert os.environ["XLA_FLAGS"] == after


def test_what_was_imported_is_no_garbage_once_and_for_all():
    begin_quickly()
    frozen = gc.get_freeze_count()
    assert frozen > 0 and gc.get_threshold()[0] > 700
    begin_quickly()  # another command of the same process: what the first one made may be garbage by now
    assert gc.get_freeze_count() <= frozen
