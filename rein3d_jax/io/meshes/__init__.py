"""Triangle meshes from files (glTF, GLB, OBJ, 3D-FRONT) and to them."""
