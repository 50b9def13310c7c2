"""Trained networks from their files, as the stages take them: the one room that knows both files and stages."""
