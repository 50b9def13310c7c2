"""Pure maths that knows no stage."""
