"""An example of how to use slip: a control law of a grip, and its closed loop without ROS."""
