"""The study of the distance network's training: what its table says, and which rooms half of them are."""

from benchmarks.studies.depth_ablation import FIGURES, SETS, half_of, table


def run(name, seed, value):
    return {"name": name, "seed": seed, **{kind: dict.fromkeys(FIGURES, value) for kind in SETS}}


def test_a_row_is_the_mean_over_seeds_and_its_standard_error():
    lines = table([run("both", 0, 0.1), run("drawn", 0, 0.4), run("both", 1, 0.3)])
    assert lines[2] == "| both | 2 | " + " | ".join(["0.200 ± 0.100"] * 6) + " |"  # sample deviation / sqrt(2)
    assert lines[3] == "| drawn | 1 | " + " | ".join(["0.400"] * 6) + " |"  # one seed has no error


def test_half_of_the_rooms_keeps_all_that_are_held_out(tmp_path):
    for number in range(20):
        room = tmp_path / "rooms" / f"room_{number:06}"
        room.mkdir(parents=True)
        (room / "room.json").write_text("{}")
    names = []
    for name, seed in (("one", 0), ("again", 0), ("other", 1)):
        half = half_of(tmp_path / "rooms", tmp_path / name, seed, 10)
        names.append(sorted(path.parent.name for path in half.glob("room_*/room.json")))
    assert names[0] == names[1] != names[2]
    assert {"room_000000", "room_000010"} <= set(names[0]) and len(names[0]) == 2 + 18 // 2
