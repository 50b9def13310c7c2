"""Frames, orders, units and named constants that every room of the house follows. No code that computes.

World           right-handed, metres, origin at the input panorama's centre; +X through its centre
                column, +Y left, +Z up.
Equirectangular column u in [0, W) has azimuth ((u + .5)/W - .5) 2 pi, turning RIGHT; row v has
                latitude (.5 - (v + .5)/H) pi. The ray of (azimuth a, latitude l) is
                (cos a cos l, -sin a cos l, sin l).
Pixels          the first pixel covers [0, 1) and has its centre at 0.5. An integer index i means the
                pixel's centre; a continuous coordinate x means i = x - 0.5.
Distance        metres along the ray, not along an axis. 0 where nothing was rendered; whether an
                input pixel's distance is known is a mask beside it, never a number.
Cameras         OpenCV axes: +x right, +y down, +z forward. An equirectangular camera looks along +z
                at its centre column.
Poses           named by their frames, read right to left: world_from_camera maps camera to world.
Quaternions     wxyz.
Colour          float32 in [0, 1], channels last. sRGB unless a name says linear. Scenes are modelled in
                sRGB, as every 3DGS viewer expects.
Alpha           1 = observed, 0 = hole.
"""

PINHOLE = "pinhole"
EQUIRECTANGULAR = "equirectangular"

NEAR = 0.01  # metres; the paper's near plane (Table 3dgs_refine_details)
FAR = 100.0  # metres; the paper's far plane

# A Gaussian's contribution below 1/255 cannot change an 8-bit pixel by itself: the 3DGS cut.
ALPHA_CUT = 1.0 / 255.0
# Above this the transmittance behind a splat could reach 0, where its gradient is undefined (gsplat's value).
ALPHA_MAX = 0.999

EYE_HEIGHT = 1.6  # metres above the floor, where a camera stands in a room
