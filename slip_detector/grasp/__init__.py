"""The control law of a grasp, and its closed loop without ROS."""
