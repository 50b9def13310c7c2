"""A room's parts as pytrees of fixed capacity. Fields only. Everything is in the room's own axes: metres,
origin at the input camera, walls along x and y, +Z up; `yaw` brings them into the world."""

import jax
from flax import struct


@struct.dataclass
class Solids:
    """Unit shapes (cube, upright cylinder or ball of radius 1), scaled, yawed and moved. Only the first `count` are
    used; the others lie far away."""

    centre: jax.Array  # (n, 3) metres
    half: jax.Array  # (n, 3) metres, half the size along the solid's own axes
    heading: jax.Array  # (n, 2) cosine and sine of the angle it is yawed LEFT about +Z
    texture: jax.Array  # (n,) int, its row of Room.textures
    object: jax.Array  # (n,) int, the piece of furniture it belongs to
    count: jax.Array  # () int
    casters: jax.Array  # () int, the first ones of them, which cast shadows


@struct.dataclass
class Textures:
    """Procedural textures: joints of a grid of cells over a grain of noise. Colours are linear reflectances."""

    ramp: jax.Array  # (m, 3, 3) colours that the noise runs through, low to high
    cell: jax.Array  # (m, 2) metres, the size of a tile, plank or brick
    shift: jax.Array  # (m,) share of a cell by which each row is moved against the one below
    joint: jax.Array  # (m,) metres, the width of the joints
    joint_shade: jax.Array  # (m,) reflectance of a joint relative to the cells
    variation: jax.Array  # (m,) how much the cells differ in brightness
    grain: jax.Array  # (m, 2) metres, wavelength of the coarsest noise
    detail: jax.Array  # (m,) amplitude of each octave relative to the coarser one
    contrast: jax.Array  # (m,) how far the noise runs along the ramp
    glow: jax.Array  # (m,) light it sends out itself, per reflectance, already exposed


@struct.dataclass
class Openings:
    """Recesses in the outer walls: boxes that begin inside the room and end at a pane."""

    centre: jax.Array  # (r, 3) metres
    half: jax.Array  # (r, 3) metres; an unused opening lies far away
    wall: jax.Array  # (r,) int, 0..3 for +x, +y, -x, -y
    window: jax.Array  # (r,) 1 for a window that shows the outside, 0 for a door
    panes: jax.Array  # (r, 2) how many panes or panels the leaf is divided into, along the wall and upwards


@struct.dataclass
class Lights:
    """Balls of light, without a surface of their own."""

    position: jax.Array  # (k, 3) metres
    radius: jax.Array  # (k,) metres: the width of shadows' edges, and no light is stronger than at this distance
    power: jax.Array  # (k, 3) linear; irradiance at one metre
    axis: jax.Array  # (k, 3) unit; a window's light goes along it
    spread: jax.Array  # (k,) 1 = the same in all directions, 0 = by the cosine to the axis


@struct.dataclass
class Outside:
    """What the windows show: a sky over a skyline, endlessly far away."""

    colours: jax.Array  # (4, 3) linear: zenith, horizon, buildings or trees, ground
    skyline: jax.Array  # (2,) mean and spread of the skyline's tangent
    scale: jax.Array  # (2,) noise cells a radian across, and relative to that upwards
    brightness: jax.Array  # () factor of the colours, already exposed


@struct.dataclass
class Room:
    """One furnished room. Rows of `textures`: floor, ceiling, the four walls, one for each opening, then whatever the
    solids name. Object ids: 0 floor, 1 ceiling, 2 to 5 walls, then openings, structure, furniture."""

    low: jax.Array  # (3,) metres, the shell's lower corner
    high: jax.Array  # (3,) metres, the shell's upper corner
    yaw: jax.Array  # () radians the room is yawed LEFT in the world
    kind: jax.Array  # () int, index into config.ROOM_KINDS
    seed: jax.Array  # () uint32 of the textures' noise
    boxes: Solids
    cylinders: Solids
    ellipsoids: Solids
    openings: Openings
    textures: Textures
    lights: Lights
    outside: Outside
    ambient: jax.Array  # (2, 3) linear radiosity that comes from below and from above
    exposure: jax.Array  # () display value per linear light
    gamma: jax.Array  # () contrast of the display, around 1
    open_windows: jax.Array  # () bool, windows give no distance, as in scans and in renders without panes
    overflow: jax.Array  # () int, solids that found no slot


@struct.dataclass
class TracedPanorama:
    """A traced panorama, or several along leading axes."""

    rgb: jax.Array  # (..., h, w, 3) sRGB in [0, 1]
    distance: jax.Array  # (..., h, w) metres along the ray
    normal: jax.Array  # (..., h, w, 3) unit, world frame, facing the camera
    object: jax.Array  # (..., h, w) int32, see Room
