"""An example of how to use slip: a control law for a grip, and its closed loop without ROS."""
