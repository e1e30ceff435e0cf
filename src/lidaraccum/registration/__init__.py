"""Points to poses: odometry, ICP, deskew. No network inside."""
