"""Bytes over the wire are those of the compiled program's collectives."""

from benchmarks.studies.machines import collective_bytes, sent

PROGRAM = """
  %all-reduce.1 = (f32[3,4]{1,0}, bf16[8]{0}, /*index=2*/f32[]) all-reduce(%a, %b, %c), channel_id=1
  %all-gather.2 = f32[448,64]{1,0} all-gather(%d), channel_id=2, dimensions={0}
  %x = f32[5]{0} add(%all-gather.2, %all-reduce.1)
  %gte = f32[3,4]{1,0} get-tuple-element(%all-reduce.1), index=0
"""


def test_each_collective_counts_what_it_gives():
    assert collective_bytes(PROGRAM) == {"all-reduce": 4 * 12 + 2 * 8 + 4, "all-gather": 4 * 448 * 64}


def test_a_ring_sends_an_array_once_and_a_sum_twice():
    assert sent({"all-reduce": 800}, 4) == 1200 and sent({"all-gather": 800}, 4) == 600
    assert sent({"all-reduce": 800}, 1) == 0
