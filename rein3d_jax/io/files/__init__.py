"""What every file needs: whole or none, checked before it is read; arrays, JSON, checkpoints, logs."""
