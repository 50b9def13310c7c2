"""How good a scene is, in numbers and in pictures."""
