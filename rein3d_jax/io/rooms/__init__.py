"""Rooms as data sets publish them: panoramas with distance, pose and ground truth."""
