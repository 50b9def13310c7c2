"""A panorama's distance: completed where one was given, estimated where none was.

    complete.complete_distance(panorama, *, config)                  every pixel finite, known ones untouched
    estimate.estimate_distance(rgb, parameters, camera_height)       by the network, lines and edges
    room_shell.fit_room_shell(rgb, camera_height, *, config)         the box by a picture's edges, and how well it fits
    room_shell.shell_distance(shell, height, width) -> distance      exact ray-box distance
    level.estimate_lean(rgb) -> Lean                                 from the picture's edges; levelled(panorama, lean)
    shell_from_distance.shell_from_distance(panorama)                 the box around what a panorama saw

Distances are metres along the ray. An estimate never becomes "known" here: validity is a mask the caller keeps.
"""

from rein3d_jax.depth.complete import CompleteConfig, complete_distance
from rein3d_jax.depth.room_shell import RoomShellConfig, fit_room_shell, shell_distance

__all__ = ["CompleteConfig", "RoomShellConfig", "complete_distance", "fit_room_shell", "shell_distance"]
