"""Triangle meshes as panoramas: ray casting, textures, and where a camera can stand. No side effects."""
