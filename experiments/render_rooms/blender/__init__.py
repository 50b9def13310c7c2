"""What runs inside Blender's own Python: draws planned rooms. Imports bpy, and nothing outside this folder."""
