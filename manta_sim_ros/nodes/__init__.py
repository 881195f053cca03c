"""The ROS 2 nodes: all of them are here, and what they do apart from the middleware, which `studies` uses as well."""
