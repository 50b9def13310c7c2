"""Every stage and both training steps lower for CUDA and TPU at the paper's sizes: abstract, states donated, no call
out of the program."""

import re

import jax
import pytest

from benchmarks.studies.accelerators import PLATFORMS, PROGRAMS, exported


@pytest.mark.slow  # lowering alone, but of the largest programs
@pytest.mark.parametrize("name", PROGRAMS)
def test_it_lowers_with_its_state_donated_and_calls_nobody(name):
    program = PROGRAMS[name]()
    lowered = exported(program)
    assert lowered.platforms == PLATFORMS
    text = lowered.mlir_module()
    assert not re.findall(r"custom_call @\S+", text)  # as a callback to the host is, or a kernel of one platform
    state = [] if program.carried is None else jax.tree.leaves(program.given[program.carried])
    assert text.count("tf.aliasing_output") == len(state)
