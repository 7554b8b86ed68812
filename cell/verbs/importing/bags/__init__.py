"""ROS bags (ROS 2: MCAP, sqlite3; ROS 1): pictures, joints and transforms into a recording."""
