"""ROS 2: packages with a verified controller, and a simulated robot for them."""
